"""What `import ctcr` offers as functions: the way of a table through the rooms, which the commands take too."""
