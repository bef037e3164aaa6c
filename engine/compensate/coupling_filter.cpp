#include "engine/compensate/coupling_filter.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace ringlock::compensate {

namespace {

constexpr double enough_to_begin = 0.15;  // error of the coupling over itself
// Bends are linear in the coupling near that of the tables: farther off, their solution only serves for better tables.
constexpr double linear_within = 0.05;
constexpr double linear_sigmas = 4.0;
constexpr double corrections_before = 64.0;  // weight of the electronics' own figures of their noise, in corrections
constexpr double corrections_kept = 8192.0;  // of 128 turns: an hour
constexpr double largest_surprise = 9.0;     // largest square of a single correction that enters the noise, in
                                             // variances
constexpr double short_over_long = 1.1;      // in variances: before that the two memories are too much the same

double squared(double value) { return value * value; }

}  // namespace

bool CouplingFilter::observe(const Bends& bends, const Coupling& tables, double turns, double duration_s) {
    if (size_begun_) predict(duration_s);
    if (!size_begun_ || !phase_begun_) return begin(bends, tables);
    correct(bends, tables, turns);
    begin_anew_where_contradicted();
    return true;
}

bool CouplingFilter::begin(const Bends& bends, const Coupling& tables) {
    const double determinant = bends.xx * bends.yy - bends.xy * bends.xy;
    if (!(determinant > 0.0)) return false;
    const double variance = noise_ * (bends.xx + bends.yy) / determinant;
    if (variance > squared(enough_to_begin)) return false;
    const double x = (bends.yy * bends.x - bends.xy * bends.y) / determinant;
    const double y = (bends.xx * bends.y - bends.xy * bends.x) / determinant;
    const bool linear = std::hypot(x, y) < std::max(linear_within, linear_sigmas * std::sqrt(variance));
    phase_rad_ = tables.phase_rad + std::atan2(y, 1.0 + x);
    ee_ = noise_ / bends.yy;
    le_ = se_ = 0.0;
    phase_begun_ = linear;
    if (!size_begun_) {
        b_rad_s_ = tables.b_rad_s * std::hypot(1.0 + x, y);
        ll_ = noise_ / bends.xx;
        ls_ = 0.0;
        ss_ = squared(slope_rms_s);
        size_begun_ = linear;
    }
    return true;
}

void CouplingFilter::predict(double duration_s) {
    b_rad_s_ *= std::exp(slope_s_ * duration_s);
    ll_ += duration_s * (2.0 * ls_ + duration_s * ss_);
    ls_ += duration_s * ss_;
    le_ += duration_s * se_;
    ss_ += squared(slope_walk_s_rt_s) * duration_s;
    ee_ += squared(phase_walk_rad_rt_s) * duration_s;
}

void CouplingFilter::correct(const Bends& bends, const Coupling& tables, double turns) {
    // x and y of the estimate, their derivatives by the logarithm l and the phase e, and the normal equations of these.
    const double ratio = b_rad_s_ / tables.b_rad_s;
    const double cosine = ratio * std::cos(phase_rad_ - tables.phase_rad);
    const double sine = ratio * std::sin(phase_rad_ - tables.phase_rad);
    const double x = bends.x - bends.xx * (cosine - 1.0) - bends.xy * sine;
    const double y = bends.y - bends.xy * (cosine - 1.0) - bends.yy * sine;
    const double l = cosine * x + sine * y;
    const double e = cosine * y - sine * x;
    const double x_of_l = bends.xx * cosine + bends.xy * sine;
    const double y_of_l = bends.xy * cosine + bends.yy * sine;
    const double x_of_e = bends.xy * cosine - bends.xx * sine;
    const double y_of_e = bends.yy * cosine - bends.xy * sine;
    const double ll = cosine * x_of_l + sine * y_of_l;
    const double le = cosine * x_of_e + sine * y_of_e;
    const double ee = cosine * y_of_e - sine * x_of_e;
    if (!(ll > 0.0 && ee > 0.0)) return;

    const double kept = 1.0 - turns / short_memory_turns;
    pull_ = kept * pull_ + e;
    weight_ = kept * weight_ + ee;
    square_ = kept * kept * square_ + ee;

    // As two independent measurements: by the rows of the root of the normal equations.
    const double of_l = std::sqrt(ll);
    const double of_both = le / of_l;
    const double rest = std::sqrt(std::max(ee - of_both * of_both, 0.0));
    const double seen_l = l / of_l;
    const double seen_e = rest > 0.0 ? (e - of_both * seen_l) / rest : 0.0;
    double change_l = 0.0;
    double change_e = 0.0;
    double surprise = 0.0;
    const auto measure = [&](double in_l, double in_e, double seen) {
        const double l_seen = ll_ * in_l + le_ * in_e;
        const double s_seen = ls_ * in_l + se_ * in_e;
        const double e_seen = le_ * in_l + ee_ * in_e;
        const double gain = 1.0 / (noise_ + in_l * l_seen + in_e * e_seen);
        const double off = seen - in_l * change_l - in_e * change_e;
        surprise += 0.5 * off * off * gain;
        change_l += gain * l_seen * off;
        slope_s_ += gain * s_seen * off;
        change_e += gain * e_seen * off;
        ll_ -= gain * l_seen * l_seen;
        ls_ -= gain * l_seen * s_seen;
        ss_ -= gain * s_seen * s_seen;
        le_ -= gain * l_seen * e_seen;
        se_ -= gain * s_seen * e_seen;
        ee_ -= gain * e_seen * e_seen;
    };
    measure(of_l, of_both, seen_l);
    measure(0.0, rest, seen_e);
    b_rad_s_ *= std::exp(change_l);
    phase_rad_ += change_e;
    pull_ -= weight_ * change_e;
    corrections_ = std::min(corrections_ + 1.0, corrections_kept);
    noise_ *= 1.0 + (std::min(surprise, largest_surprise) - 1.0) / (corrections_before + corrections_);
}

void CouplingFilter::begin_anew_where_contradicted() {
    // The short memory's turns are in the long one too: the difference has the difference of the variances.
    const double short_variance = noise_ * square_ / squared(weight_);
    if (!(short_variance > short_over_long * ee_)) return;
    const double off = pull_ / weight_;
    if (squared(off) < squared(sigmas_) * (short_variance - ee_)) return;
    phase_begun_ = false;
    pull_ = weight_ = square_ = 0.0;
    ++restarts_;
}

}  // namespace ringlock::compensate
