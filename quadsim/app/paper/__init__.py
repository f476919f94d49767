"""The paper, rerun: one module for each table or figure, `run(runs, folder)` in it. See docs/paper.md."""
