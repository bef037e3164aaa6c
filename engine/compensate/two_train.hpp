#pragma once
#include "engine/compensate/lane_compensator.hpp"

namespace ringlock::compensate {

/// Two trains of corrections, scaled so that the output varies least (Fan, Luo, Hu, Xiao, Opt. Eng. 50, 034403, 2011):
/// learns the threshold and the coupling phase of a gyro from its readings, without a calibration of either.
///
/// With s, c the unit sine and cosine of the phase read and a = psi'' averaged over turns, as in FirstOrder, half a
/// kick of a coupling b sin(psi + phi) is B1 = b cos phi times that of the first train and B2 = b sin phi times that of
/// the second [rad/s], where a unit of them gives (sqrt(pi/a)/2 each)
///
///     before or after a minimum:  s + c  and  c - s,
///     before or after a maximum:  s - c  and  c + s.
///
/// At the minima of the phase the dither drops out but for its noise, so that with the trains summed up, C1 and C2,
///
///     phase = constant + rate t + B1 C1 + B2 C2 + noise.
///
/// Phase, C1 and C2 go through the same two one-pole high-passes of 0.5 s, which remove constant and ramp. White noise,
/// such as the injected noise of s rad at a turn, hides the trains at short times; a random walk that is no lock-in, of
/// q rad a cycle, hides them at long ones. The variance of B is proportional to 5 s^2/T + q^2 T (T in cycles), least at
/// T = sqrt(5) s/q: 2 s for 3 rad and the walk of 5e-4 deg/sqrt(h), where 0.5 s costs a factor of 1.5 in the standard
/// deviation, and more for a quieter gyro. It is kept short for the sake of rates that drift, of a quick start, and
/// because it is enough: the error of the first order is no less. Then B1 and B2 are those of least squares with
/// weights that fade over 1000 s, solved for every 128 turns. Behind injected noise, white s rad, each is uncertain by
///
///     b (s/kappa) sqrt(5/2/(n T)),      kappa = b sqrt(2 pi/a), n cycles seen (at most two times 1000 s)
///
/// (5/8 is the mean of the high-passes' gain over the spectrum of the filtered walk, 1/4 T its variance a cycle): 2.5 %
/// of the paper's threshold after 200 s and 0.8 % in the long run, which the correction leaves of the error sqrt(2)
/// times. Without injected noise the phase is quiet and B sharper by far, where the input turns the gyro: 0.4 % after
/// 200 s at 15 deg/h. In a dead band the lock-in cancels the input and its noise: phase and trains stand still, B is
/// undetermined, and the correction may be worse than none. The same holds for too little noise about an input of zero:
/// noise and the kick of the same turn are correlated in proportion to exp(-s^2/2), which is negligible for 3 rad and a
/// third for 1.5 rad: B is off by 20 % then.
///
/// The first 8 s settle the high-passes and the next 8 s are only learnt from: B = 0 until 16 s. The correction is the
/// sum of B's current value times the trains' increments, so that a better B makes no step.
///
/// State: 33 numbers a gyro, 264 bytes; a cycle takes four square roots, eight divisions and some forty
/// multiplications.
class TwoTrain final : public LaneCompensator {
   public:
    /// Of the calibration only the durations are used, for the period.
    explicit TwoTrain(const Calibration& calibration);

    void observe(const readout::LaneReadings& readings, LaneErrors& errors) override;

    /// As learnt so far: b cos phi and b sin phi.
    double first_rad_s(std::size_t lane) const { return state_.b_rad_s[0][lane]; }
    double second_rad_s(std::size_t lane) const { return state_.b_rad_s[1][lane]; }

    struct State {
        simd::Lanes decay;          ///< of the high-passes, a cycle
        simd::Lanes forgetting;     ///< of the sums, a cycle
        simd::Lanes settle, learn;  ///< minima until the sums begin and B is solved for
        /// [before a minimum, after it, before a maximum, after it]
        simd::Lanes mean_rad_s2[4];
        simd::Lanes count[4];
        simd::Lanes after_last[2];             ///< trains' half kicks after the last turn
        simd::Lanes pending[2];                ///< gain of the trains from the last minimum to the last turn
        simd::Lanes last_fringes, last_whole;  ///< phase at the last minimum
        simd::Lanes once[3], twice[3];         ///< high-passed phase, trains [fringes, fringes s/rad]
        simd::Lanes c11, c12, c22, c1y, c2y;   ///< faded sums of products
        simd::Lanes b_rad_s[2];
        simd::Lanes error_fringes, error_whole;
    };

   private:
    std::size_t lanes_;
    State state_{};
};

}  // namespace ringlock::compensate
