"""Plant and law as functions of flat vectors, compiled: in continuous time, and period by period."""
