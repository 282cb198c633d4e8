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
    double peak_rpm;     /* of every profile but "table" */
    double ramp_s;       /* likewise */
    const double *time_s;    /* of "table": increasing, the first 0 */
    const double *speed_rpm; /* of "table": speeds at these times, linear in between */
    size_t spin_points;
    /* parameters that differ from the paper's machine, as in `sweep parameters` */
    const char *const *names;
    const double *values;
    size_t constants;
} washer_setup;

enum washer_status {
    WASHER_OK = 0,
    WASHER_NULL = 1,           /* a pointer that must not be null is, or a text is not UTF-8 */
    WASHER_UNKNOWN_NAME = 2,   /* no such model, profile or parameter */
    WASHER_OUT_OF_RANGE = 3,   /* a machine or spin that cannot be */
    WASHER_NO_EQUILIBRIUM = 4, /* the springs cannot carry the machine */
};

/* Makes a machine; on WASHER_OK, *made must go to washer_free. */
enum washer_status washer_new(const washer_setup *setup, washer **made);
void washer_free(washer *machine);

/* Numbers of a state: 20. */
size_t washer_dimension(void);
/* At rest in static equilibrium: where trajectories start. */
void washer_initial_state(const washer *machine, double *x);
/* dx = f(t, x). The order of arguments is that of right-hand sides in other programs. */
void washer_rhs(double t_s, const double *x, double *dx, washer *machine);
/* df/dx, row by row: jacobian[row * dimension + column]. */
void washer_jacobian(double t_s, const double *x, double *jacobian, washer *machine);

/* What is observed: deviations from equilibrium (m, rad). */
size_t washer_channels(void);
/* NULL from washer_channels() on; the text lives forever. */
const char *washer_channel_name(size_t channel);
/* All channels and their rates per second. */
void washer_outputs(double t_s, const double *x, double *values, double *rates, washer *machine);

#ifdef __cplusplus
}
#endif

#endif
