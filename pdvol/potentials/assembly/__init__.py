"""Cell kernels, the block pattern of Hessians, and the sum of blocks."""
