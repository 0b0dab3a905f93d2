"""What a run is measured by: the ideal mass-spring-damper, overshoot and settling, and what is kept of a sample."""
