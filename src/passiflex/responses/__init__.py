"""What a response is measured by: the ideal mass-spring-damper, overshoot, settling time."""
