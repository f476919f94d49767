"""The configuration of a flight: settings, presets, Spec, and how a Spec is built."""
