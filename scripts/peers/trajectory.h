/* The trajectories of the comparison and the measurement of their results, the same for all
 * programs. Each line of standard input, `MODEL UNBALANCE_MASS DAMPING`, gives a trajectory and a
 * line of JSON. */
#ifndef TRAJECTORY_H
#define TRAJECTORY_H

#include "washer.h"

#ifdef __cplusplus
extern "C" {
#endif

#define DIMENSION 20

/* Reads a line, writes the state at 0 s to `x` and starts the clock. Returns the machine, or NULL
 * without a line. */
washer *next_machine(double *x);
/* Returns the i-th time of a sample, or INFINITY after the last one. Programs compute samples by
 * their own dense output. */
double sample_time(int i);
/* Records the state at the i-th time. */
void sample(int i, const double *x);
/* Stops the clock, prints the result and frees the machine. */
void report(washer *machine, const char *program, const char *method, double rtol, double atol);

#ifdef __cplusplus
}
#endif

#endif
