#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/sums/phase.hpp"
#include "analysis/allan_run/coefficient_table.hpp"
#include "analysis/allan_run/outcome.hpp"
#include "analysis/allan_run/taus.hpp"
#include "analysis/allan_run/wrap.hpp"
#include "analysis/quantity/unit.hpp"
#include "analysis/record/series/series.hpp"

namespace ringlock::allan_run {

/// The request for the analysis of a series, checked as far as it can be without the data.
struct Request {
    allan::Kind kind = allan::Kind::phase;
    std::string kind_name;
    std::optional<quantity::Unit> unit;
    const WalkUnit* walk_unit = nullptr;
    std::vector<allan::Estimator> estimators;
    TauChoice taus;
    allan::Options options;  ///< confidence and bias
    WrapChoice wrap;
    bool clean = false;  ///< deviations, too, are of the data without the faults that can be taken off

    double scale() const { return unit ? unit->factor : 1.0; }
};

/// Names that messages have for the series and for the options of the caller.
struct Names {
    std::string data;    ///< of the file or the data, printable
    std::string series;  ///< of the series in it, printable: "FILE: column NAME"
    std::string_view taus = "--tau";
    std::string_view wrap = "--wrap";
    std::string_view clean = "--clean";
};

/// "phase", "increment" or "rate".
std::string_view name_of(allan::Kind kind);

/// Phase of a series, in the unit of the deviations times seconds.
allan::Phase phase_of(const Request& request, const record::Series& series, double tau0_s);

/// The fields of an outcome that follow from the request.
void describe(const Request& request, double tau0_s, AllanOutput& out);

/// Undoes wraps and takes faults from the data, where that is asked for; the outcome says what was done. Throws
/// InputError.
void prepare(const Request& request, const Names& names, record::Series& series, AllanOutput& out);

/// Deviations, findings and noise coefficients of a series that is prepared; the series is used up. Throws InputError
/// where it is too short.
void evaluate(const Request& request, const Names& names, record::Series& series, AllanOutput& out);

/// Throws InputError where the series is too short for any deviation.
void check_size(const Names& names, allan::Kind kind, std::int64_t points, std::size_t data);

}  // namespace ringlock::allan_run
