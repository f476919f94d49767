"""Many races of several vehicles: runner, store, statistics and comparison."""
