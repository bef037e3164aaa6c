#pragma once
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/record/record.hpp"
#include "engine/gyro/setup.hpp"

/// Records with known truth for the closed loop to read blind, and what its answers are worth.
namespace ringlock::test::closure {

/// What is in a record beside the base model: parameters by name, those of the library's effects as the library names
/// them.
struct Added {
    std::string effect;
    std::map<std::string, double> values;
};

/// The gyro and what it goes through.
struct Condition {
    const char* name;
    double injected_rad;
    bool moving;              ///< input rates of either sign, and a dither whose amplitude drifts and walks
    bool other_gyro = false;  ///< of another scale factor, dither and readout, one in three locked; noise as drawn
};
extern const std::vector<Condition> conditions;
extern const Condition other_gyro;

/// Seeds of one series of records are apart from those of another by this.
constexpr std::uint64_t seeds_of_series = 1'000'000;

enum class Kind { null, single, pair, foreign, other, several, mixed };
const char* name_of(Kind kind);

struct Case {
    Kind kind = Kind::null;
    std::vector<Added> truth;         ///< of the library
    std::vector<Added> foreign = {};  ///< that the library does not have
    double multiple = 0.0;            ///< of the detection limit of what is of the library; 0 for nulls
    const Condition* condition = nullptr;
    bool direct = false;  ///< by the generator's integration of the equation of motion, not by the turn map
    std::uint64_t seed = 1;
    std::uint64_t noise = 0;  ///< another draw of all that is random in the same gyro; of the turn map only
    std::size_t turns = 16000;
    std::optional<gyro::Setup> gyro = {};  ///< whose scale factor, dither and threshold stand in place of the paper's
    ringlock::closure::Where where = {};   ///< in which foreign effects show themselves

    std::vector<Added> added() const;
    std::string truth_text() const;
};

/// The records of cases, those of the generator in one go. Threshold, amplitude and rate of the gyro differ from seed
/// to seed; declared is the nominal threshold.
std::vector<record::Record> make(std::span<const Case> cases);

std::string text_of(const std::vector<Added>& added);

/// How long the record of a case is.
double duration_s(const Case& of);

/// Where a random parameter of an effect stands in a case of that seed: frequencies, phases and times are drawn, the
/// size is `size`.
Added draw(const std::string& effect, double size, std::uint64_t seed, double duration_s);

/// Effects of the library that turn records can show.
std::vector<std::string> effects_on_turns();

/// A size of an effect to start from, about where limits are.
double start_size(const std::string& effect);

/// Sets the sizes of a case to `multiple` times their detection limits in such a record, where the standard error is a
/// quarter of the size: by Fisher's information in the true model, at the truth. Other parameters stay as drawn; sizes
/// are only a start. False where the record would not show one of them within the effect's bounds.
bool settle(Case& of);

/// Cases of effects that the library does not have; others for every series.
std::vector<Case> foreign_cases(std::size_t each, std::uint64_t series = 0);

enum class Judged {
    right,        ///< nothing missing in a null; all effects named, no other; what is foreign at its place, unexplained
    tie,          ///< ties hold all that is true
    missed,       ///< not all of the truth is there, nothing false is
    unexplained,  ///< and not outside the library, or with another place
    wrong,        ///< an effect that is not there is named, without a tie that holds the truth
};
const char* name_of(Judged judged);

struct Outcome {
    Judged judged = Judged::wrong;
    bool false_name = false;  ///< some step names what is not there and ties it to nothing that is
    std::string verdict;
    std::string named;  ///< "effect~tied+effect"
    std::string where;
    double before = 0.0, after = 0.0, floor = 0.0;
    double oracle = 0.0;  ///< held-out error of the true model; NaN where the library does not have it
    /// Of the true model and of the one answered over the base model, on the rows that choose [nats]; NaN where there
    /// is none. Effects that change the phases as they are read have another base.
    double truth_gain = std::numeric_limits<double>::quiet_NaN();
    double answer_gain = std::numeric_limits<double>::quiet_NaN();
    std::vector<std::string> missing;                              ///< true effects that are neither named nor tied
    double asked_gain = std::numeric_limits<double>::quiet_NaN();  ///< for these, see gain_asked
    double seconds = 0.0;
    struct Deviation {
        std::string parameter;
        double value, sd, standard_errors;
    };
    std::vector<Deviation> deviations;  ///< of the estimates, where the truth has been named
    std::string closed_fault = {};      ///< what is wrong with the closed scenario; empty: nothing
};

/// What the least of these effects must add to the log-likelihood [nats] to pass the family-wise level over a library
/// of that size, were its time or frequency known beforehand. NaN where there is none, or one that other columns tell
/// of.
double gain_asked(const std::vector<std::string>& missing, double library);

/// An answer held against the truth: what was said, and what that is judged. The oracle's error is left to be found.
/// \param where  something that the library does not have shows itself there
void compare(const ringlock::closure::Closure& closure, std::optional<ringlock::closure::Where> where,
             const std::vector<Added>& truth, Outcome& outcome);

Outcome judge(const Case& of, const record::Record& record);

/// Why the closed scenario of a record breaks a rule of scenarios, is not read back from closed.toml as it was, or
/// cannot be simulated for a few seconds; empty where it can.
std::string fault_of_closed(const record::Record& record, const ringlock::closure::Closure& closure);

}  // namespace ringlock::test::closure
