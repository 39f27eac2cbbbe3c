"""What may explain a recording, searched by what each explanation would gain."""
