"""What an exported controller needs on a microcontroller."""
