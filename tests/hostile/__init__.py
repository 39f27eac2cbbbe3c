"""What nobody should be able to do to this tool by handing it a file."""
