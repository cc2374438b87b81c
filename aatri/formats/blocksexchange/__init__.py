"""BlocksExchange XML of ContextCapture (iTwin Capture), DJI Terra, Metashape."""
