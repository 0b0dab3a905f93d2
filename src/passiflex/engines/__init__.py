"""Other simulators that a sampled loop may run on, in place of the native one."""
