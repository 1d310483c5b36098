/* The barrier's law. */
#ifndef PDVOL_LAW_H
#define PDVOL_LAW_H
#include <math.h>

#include "../../positive.h"

/* The barrier's law kappa dhat g(s), g(s) = -(s - 1)^2 ln s, s = (gap / dhat)^2, and its first two derivatives by gap^2; these are zero where there is
 * no gap. */
INLINE double law(double squared, double dhat, double kappa, double *slope, double *second)
{
    const double s = squared / (dhat * dhat);
    *slope = *second = 0.0;
    if (!(s > 0.0 && s < 1.0))
        return s > 0.0 ? 0.0 : INFINITY;
    const double logarithm = log(s), rest = s - 1.0;
    *slope = -kappa / dhat * rest * (2.0 * logarithm + rest / s);
    *second = -kappa / (dhat * dhat * dhat) * (2.0 * logarithm + 4.0 * rest / s - rest * rest / (s * s));
    return -kappa * dhat * rest * rest * logarithm;
}
#endif
