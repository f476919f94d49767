"""The paper, rerun: a function for each table or figure, `name(runs, folder) -> Result`. See
docs/paper.md."""
