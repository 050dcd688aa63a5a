"""The functions of `import ctcr`: each takes a table through the rooms, as its command does."""
