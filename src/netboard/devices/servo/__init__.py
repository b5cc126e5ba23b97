"""What the servo threads of several vendors share: samples, forces and errors between threads, and compiling them."""
