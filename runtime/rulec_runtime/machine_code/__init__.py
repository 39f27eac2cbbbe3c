"""Machine code: written for LLVM, made for this machine, kept for the next start."""
