"""Work in chunks: computed by any engine, kept in a folder that survives whatever interrupts it."""
