/* The equations of motion of a washing machine, x' = f(t, x), for any integrator.
 *
 * A state holds the ten coordinates q1 to q10 (m, rad), then their speeds (m/s, rad/s). One thread
 * at a time may use a `washer`.
 */
#ifndef WASHER_H
#define WASHER_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct washer washer;

typedef struct washer_setup {
    const char *model;   /* "nonlinear" or "linear" */
    const char *profile; /* "cycloidal", "triangular", "ramp" or "table" */
    double peak_rpm;     /* the greatest speed of every profile but "table" */
    double ramp_s;       /* the duration of the run-up of every profile but "table" */
    const double *time_s;    /* the times of the profile "table": rising, the first 0 */
    const double *speed_rpm; /* the speeds at these times, linear in between */
    size_t spin_points;      /* the number of the table's points */
    /* the names and values of parameters that differ from the paper's machine, as in
     * `sweep parameters` */
    const char *const *names;
    const double *values;
    size_t constants; /* the number of named parameters */
} washer_setup;

enum washer_status {
    WASHER_OK = 0,
    WASHER_NULL = 1,           /* a pointer that must not be null is, or a text is not UTF-8 */
    WASHER_UNKNOWN_NAME = 2,   /* a model, profile or parameter with this name does not exist */
    WASHER_OUT_OF_RANGE = 3,   /* numbers are out of range or contradict each other */
    WASHER_NO_EQUILIBRIUM = 4, /* the springs cannot carry the machine */
};

/* Makes the equations of a machine. On WASHER_OK, *machine_out must be freed by washer_free. */
enum washer_status washer_new(const washer_setup *setup, washer **machine_out);
void washer_free(washer *machine);

/* Returns the length of a state: 20. */
size_t washer_dimension(void);
/* Writes the state at rest in static equilibrium, from which trajectories start. */
void washer_initial_state(const washer *machine, double *x);
/* Computes dx = f(t, x). Other integrators pass the arguments in this order too. */
void washer_rhs(double t_s, const double *x, double *dx, washer *machine);
/* Computes the Jacobian df/dx, row by row: jacobian[row * dimension + column]. */
void washer_jacobian(double t_s, const double *x, double *jacobian, washer *machine);

/* Returns the number of channels, which are deviations from equilibrium (m, rad). */
size_t washer_channels(void);
/* Returns the name of a channel, which is never freed; NULL from washer_channels() on. */
const char *washer_channel_name(size_t channel);
/* Computes all channels and their rates per second. */
void washer_outputs(double t_s, const double *x, double *values, double *rates, washer *machine);

#ifdef __cplusplus
}
#endif

#endif
