#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "analysis/record/record.hpp"
#include "tests/closure/generator/samples.hpp"
#include "tests/closure/suite/suite.hpp"

/// Records of uniform samples with known truth for the closed loop to read blind. All are made by samples.hpp, which
/// shares nothing with the engine.
namespace ringlock::test::closure {

/// The gyro's output and what stands beside it.
struct SampleCondition {
    const char* name;
    double white_angle_arcsec, white_rate_deg_rt_h;
    record::SampleKind kind;
    bool accelerometers;
    bool warm;             ///< temperature that swings and drifts
    bool moving;           ///< known input rates of either sign
    double digits_arcsec;  ///< steps of the values, far below the noise
    double dither_hz;      ///< declared; 0: not
};
extern const std::vector<SampleCondition> sample_conditions;

struct SampleCase {
    Kind kind = Kind::null;
    std::vector<Added> truth;         ///< of the library
    std::vector<Added> foreign = {};  ///< that the library does not have
    double multiple = 0.0;            ///< of the detection limit of what is of the library; 0 for nulls
    const SampleCondition* condition = nullptr;
    std::uint64_t seed = 1;
    std::size_t size = 30000;
    double rate_hz = 100.0;
    std::optional<double> other_dither_hz = {};  ///< where the condition declares one
    ringlock::closure::Where where = {};         ///< in which foreign effects show themselves

    std::vector<Added> added() const;
    std::string truth_text() const;
    double duration_s() const { return static_cast<double>(size) / rate_hz; }
    double dither_hz() const {
        return condition->dither_hz > 0.0 ? other_dither_hz.value_or(condition->dither_hz) : 0.0;
    }
};

record::Record make(const SampleCase& of);

/// Effects of the library that samples can show, and whether they do in that condition.
std::vector<std::string> effects_on_samples();
bool shows(const std::string& effect, const SampleCondition& condition);

/// An effect of about its detection limit, frequencies, phases, times and signs drawn.
Added draw_on_samples(const std::string& effect, const SampleCase& of);

/// Sets the sizes of a case to `multiple` times their detection limits in this very record: the size whose standard
/// error, by Fisher's information in the model that has all its effects, is a quarter of it.
///
/// Three effects have no such size. Quantisation: of its step the values tell without error; here it is the step whose
/// step^2/12 is four standard errors of the white angle noise's variance, what the spectrum would show. Motion of the
/// case: the rms whose response to the witness has a standard error of a quarter. Resampling is there or not.
void settle(SampleCase& of);
bool has_size(const std::string& effect);

/// Cases of effects that the library does not have.
std::vector<SampleCase> foreign_sample_cases(std::size_t each, std::uint64_t series = 0);

Outcome judge(const SampleCase& of, const record::Record& record);

}  // namespace ringlock::test::closure
