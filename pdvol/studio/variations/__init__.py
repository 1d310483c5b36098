"""Many runs of one scene: variations, their jobs, and what is made of them."""
