"""The paper's tables, figures and claims beside ours (Boyer et al., RA-L 2024)."""
