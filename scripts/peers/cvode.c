/* Integrates the trajectories of trajectory.h by SUNDIALS CVODE:
 * cvode bdf|adams MAX_ORDER RTOL ATOL */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_version.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>

#include "trajectory.h"

static int right_hand_side(realtype t, N_Vector x, N_Vector dx, void *machine) {
    washer_rhs(t, N_VGetArrayPointer(x), N_VGetArrayPointer(dx), machine);
    return 0;
}

static int jacobian(realtype t, N_Vector x, N_Vector fx, SUNMatrix j, void *machine, N_Vector a,
                    N_Vector b, N_Vector c) {
    (void)fx, (void)a, (void)b, (void)c;
    double rows[DIMENSION * DIMENSION];
    washer_jacobian(t, N_VGetArrayPointer(x), rows, machine);
    for (int row = 0; row < DIMENSION; ++row)
        for (int column = 0; column < DIMENSION; ++column)
            SM_ELEMENT_D(j, row, column) = rows[row * DIMENSION + column];
    return 0;
}

/* Ends the program if a call has failed, because a part of a trajectory cannot be compared. */
static void check_status(int status, const char *call) {
    if (status < 0) {
        fprintf(stderr, "%s: %d\n", call, status);
        exit(1);
    }
}

int main(int argc, char **argv) {
    if (argc != 5) {
        fprintf(stderr, "usage: cvode bdf|adams MAX_ORDER RTOL ATOL\n");
        return 2;
    }
    const int lmm = strcmp(argv[1], "bdf") == 0 ? CV_BDF : CV_ADAMS;
    const int order = atoi(argv[2]);
    const double rtol = atof(argv[3]), atol = atof(argv[4]);
    char program[64], method[64];
    snprintf(program, sizeof program, "SUNDIALS CVODE %s", SUNDIALS_VERSION);
    snprintf(method, sizeof method, "%s, order to %d", lmm == CV_BDF ? "BDF" : "Adams", order);

    SUNContext context;
    check_status(SUNContext_Create(NULL, &context), "SUNContext_Create");
    N_Vector x = N_VNew_Serial(DIMENSION, context);
    SUNMatrix matrix = SUNDenseMatrix(DIMENSION, DIMENSION, context);
    SUNLinearSolver solver = SUNLinSol_Dense(x, matrix, context);
    for (washer *machine; (machine = next_machine(N_VGetArrayPointer(x)));) {
        void *cvode = CVodeCreate(lmm, context);
        check_status(CVodeInit(cvode, right_hand_side, 0.0, x), "CVodeInit");
        check_status(CVodeSStolerances(cvode, rtol, atol), "CVodeSStolerances");
        check_status(CVodeSetUserData(cvode, machine), "CVodeSetUserData");
        check_status(CVodeSetMaxOrd(cvode, order), "CVodeSetMaxOrd");
        check_status(CVodeSetMaxNumSteps(cvode, 1000000000L), "CVodeSetMaxNumSteps");
        check_status(CVodeSetLinearSolver(cvode, solver, matrix), "CVodeSetLinearSolver");
        check_status(CVodeSetJacFn(cvode, jacobian), "CVodeSetJacFn");
        for (int i = 0; isfinite(sample_time(i)); ++i) {
            realtype reached_s;
            check_status(CVode(cvode, sample_time(i), x, &reached_s, CV_NORMAL), "CVode");
            sample(i, N_VGetArrayPointer(x));
        }
        report(machine, program, method, rtol, atol);
        CVodeFree(&cvode);
    }
    SUNLinSolFree(solver);
    SUNMatDestroy(matrix);
    N_VDestroy(x);
    SUNContext_Free(&context);
    return 0;
}
