"""What people see and programs read: terminal output, JSON, figures, HTML pages."""
