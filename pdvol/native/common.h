/* What all files share. Each file is compiled for two dimensions and for three: DIM is on the compiler's command line. */
#pragma once
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "interface.h"

enum { d = DIM, dd = DIM * DIM };

/* Called with a size that is a constant, so that the loops over it unroll: two to three times faster. */
#define INLINE static inline __attribute__((always_inline))
