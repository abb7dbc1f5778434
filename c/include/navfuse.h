/* A live run of navfuse inside a C or C++ program. */
#ifndef NAVFUSE_H
#define NAVFUSE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A filter on a thread of its own. All functions may be called from any thread, but for
 * navfuse_stop, after which nobody may use the run. */
typedef struct navfuse_run navfuse_run;

/* The newest estimate. A value that the scenario does not estimate is NaN. */
typedef struct navfuse_estimate {
    double time_s;                     /* on the clock of the run */
    double position_deg_deg_m[3];      /* latitude, longitude, height above the ellipsoid */
    double position_sigma_ned_m[3];    /* 1-sigma north, east, down */
    double velocity_ned_mps[3];        /* north, east, down */
    double velocity_sigma_ned_mps[3];
    double roll_pitch_heading_deg[3];
    double attitude_sigma_ned_deg[3];  /* 1-sigma about north, east, down */
} navfuse_estimate;

/* Starts the scenario of a file, whose samples the program pushes. Log (run.mcap), checkpoint and state go
 * to the folder `out`; with NULL nothing is written. On failure the result is NULL, and `error`, of `size`
 * bytes, holds the reason. */
navfuse_run *navfuse_start(const char *scenario, const char *out, char *error, size_t size);

/* The number of the sensor [sensor.NAME], or -1. */
int32_t navfuse_sensor(const navfuse_run *run, const char *name);

/* Hands a sample over: its time in ns on the clock of the run, and its channels in SI, in the order of
 * `navfuse list TYPE`; NaN stands for a channel without a value. The result is 1; it is 0 where the filter
 * is 4096 samples behind, and -1 for no such sensor or more than 16 channels. */
int32_t navfuse_push(const navfuse_run *run, int32_t sensor, int64_t time_ns,
                     const double *channels, size_t count);

/* Copies the estimate after all samples that the filter has taken. The result is 1, or 0 before there is
 * an estimate. */
int32_t navfuse_newest(const navfuse_run *run, navfuse_estimate *estimate);

/* Ends the run once the samples that were pushed are used, completes its log and frees it. The result is
 * 0, or 1 where an error ended the run. NULL is allowed. */
int32_t navfuse_stop(navfuse_run *run);

#ifdef __cplusplus
}
#endif
#endif
