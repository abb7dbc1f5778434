// The time of an IMU sample in KF-GINS.
//
// Standard input gives the number of samples as eight bytes, then eight numbers for each sample: its
// time and interval (s), the increments of angle (rad) and velocity (m/s). After that, each byte asks
// for one round: a new engine propagates through all samples, and the program prints the processor
// time of the round in seconds.
#include "kf-gins/gi_engine.h"

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <vector>

static double processor_time() {
    timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

static GINSOptions options() {
    const Eigen::Vector3d zero(0, 0, 0), one(1, 1, 1);
    const double degree = M_PI / 180, hour = 3600;
    GINSOptions o;
    o.initstate = {{30 * degree, 0, 0}, zero, {3 * degree, 0, 350 * degree}, {zero, zero, zero, zero}};
    o.initstate_std = {10 * one, 0.1 * one, 0.1 * degree * one,
                       {0.01 * degree / hour * one, 5e-4 * one, 1e-4 * one, 1e-4 * one}};
    o.imunoise = {0.003 * degree / 60 * one, 3e-4 * one, 0.01 * degree / hour * one, 5e-4 * one,
                  1e-4 * one, 1e-4 * one, hour};
    return o;
}

int main() {
    std::uint64_t count = 0;
    if (std::fread(&count, sizeof count, 1, stdin) != 1) return 1;
    std::vector<IMU> samples(count);
    for (IMU &imu : samples) {
        double n[8];
        if (std::fread(n, sizeof n, 1, stdin) != 1) return 1;
        imu = {n[0], n[1], {n[2], n[3], n[4]}, {n[5], n[6], n[7]}, 0};
    }
    std::cout.setstate(std::ios::failbit); // the engine prints its options
    while (std::getchar() != EOF) {
        GINSOptions o = options();
        GIEngine engine(o);
        engine.addGnssData({1e9, {0, 0, 0}, {1, 1, 1}, true}); // a fix that never comes
        engine.addImuData(samples[0]);
        const double begin = processor_time();
        for (const IMU &imu : samples) {
            engine.addImuData(imu);
            engine.newImuProcess();
        }
        const double spent = processor_time() - begin;
        const double trace = engine.getCovariance().trace();
        std::printf("%.9f %g\n", spent, trace);
        std::fflush(stdout);
    }
}
