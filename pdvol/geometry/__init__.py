"""Pure geometry: arrays in, arrays out. Level meshes, crossings, searches on boundaries."""
