/* The work of the comparison and how its result is taken, the same for every program: a trajectory
 * per line of standard input, `MODEL UNBALANCE_MASS DAMPING`, and a line of JSON for it. */
#ifndef TRAJECTORY_H
#define TRAJECTORY_H

#include "washer.h"

#ifdef __cplusplus
extern "C" {
#endif

#define DIMENSION 20

/* The next line's machine, at rest at 0 s in `x`, or NULL. The clock runs from here. */
washer *next_machine(double *x);
/* When its state is wanted, by the program's own dense output: the i-th time; INFINITY after the
 * last. */
double sample_time(int i);
/* The state then. */
void sample(int i, const double *x);
/* Stops the clock, prints what came of it and frees the machine. */
void report(washer *machine, const char *program, const char *method, double rtol, double atol);

#ifdef __cplusplus
}
#endif

#endif
