/* A vehicle that stands still for 20 s: its program pushes IMU, depth and position, and reads the
 * estimate. Arguments: the scenario, and a folder for the log.
 *
 *   cc -Ic/include c/examples/dive.c -Ltarget/debug -lnavfuse_c -lm -o dive
 */
#include <navfuse.h>
#include <math.h>
#include <stdio.h>

/* The Earth's rate and gravity at 45 degrees north, heading north: forward, right, down. */
static const double imu[6] = {5.156e-5, 0.0, -5.156e-5, 0.0, 0.0, -9.8062};
static const double fix[3] = {0.78539816339745, 0.1, 0.0}; /* rad, rad, m */

int main(int count, char **arguments) {
    char error[1024] = "";
    if (count < 2) {
        fprintf(stderr, "usage: dive SCENARIO [FOLDER]\n");
        return 2;
    }
    navfuse_run *run =
        navfuse_start(arguments[1], count > 2 ? arguments[2] : NULL, error, sizeof error);
    if (run == NULL) {
        fprintf(stderr, "%s\n", error);
        return 1;
    }
    int32_t inertial = navfuse_sensor(run, "imu");
    int32_t gnss = navfuse_sensor(run, "gnss");
    int32_t depth = navfuse_sensor(run, "depth");
    if (navfuse_sensor(run, "sonar") != -1 || navfuse_push(run, 99, 0, imu, 6) != -1) {
        fprintf(stderr, "a sensor that is not there\n");
        return 1;
    }
    for (int64_t k = 0; k <= 2000; k++) {
        int64_t time = k * 10000000; /* 100 Hz, in ns */
        double zero = 0.0;
        while (navfuse_push(run, inertial, time, imu, 6) == 0) {
            /* the filter is 4096 samples behind */
        }
        if (k % 100 == 0) {
            navfuse_push(run, gnss, time, fix, 3);
            navfuse_push(run, depth, time, &zero, 1);
        }
    }
    navfuse_estimate estimate;
    while (navfuse_newest(run, &estimate) == 0 || estimate.time_s < 19.9) {
        /* until the filter has taken the samples */
    }
    printf("%.2f s: %.6f deg %.6f deg, 1-sigma %.2f m; heading sigma %.1f deg\n", estimate.time_s,
           estimate.position_deg_deg_m[0], estimate.position_deg_deg_m[1],
           estimate.position_sigma_ned_m[0], estimate.attitude_sigma_ned_deg[2]);
    return navfuse_stop(run) != 0 || fabs(estimate.velocity_ned_mps[0]) > 0.1;
}
