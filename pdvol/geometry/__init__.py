"""Pure geometry: arrays in, arrays out. Level meshes, closest points, crossings, searches on boundaries."""
