"""The configuration of a flight: settings, presets, Spec, and the parts built from a Spec."""
