"""What `compax sim` is made of: the devices it serves, what it shows, and the hands of a person who plays them."""
