"""Output for people and programs: terminal, JSON, figures, HTML pages."""
