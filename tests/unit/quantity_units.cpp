// Spellings of units, sizes of counts, and what names declare.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "analysis/quantity/declared.hpp"
#include "analysis/quantity/scale.hpp"
#include "analysis/quantity/unit.hpp"
#include "engine/core/error.hpp"

namespace quantity_units_test {
namespace {

using namespace ringlock;
using quantity::find_unit;
using quantity::Instrument;
using testing::HasSubstr;

template <class Call>
std::string complaint_of(const Call& call) {
    try {
        call();
    } catch (const InputError& error) {
        return error.what();
    }
    return "";
}

void expect_names(const char* name, std::initializer_list<const char*> spellings) {
    for (const char* spelling : spellings) {
        const auto unit = find_unit(spelling);
        ASSERT_TRUE(unit) << spelling;
        EXPECT_EQ(unit->name, name) << spelling;
    }
}

TEST(Units, SpellingsOfTheField) {
    expect_names("deg/s", {"deg/s", "dps", "DPS", "Deg/S", "[deg/s]", "(deg / s)", "\xC2\xB0/s", "degrees/second",
                           "deg s^-1", "deg s-1", "deg*s**-1", "degree per second", " deg/sec "});
    expect_names("rad/s", {"rad/s", "[rad s^-1]", "radians/second", "rad\xC2\xB7s\xE2\x81\xBB\xC2\xB9", "rad_s^-1"});
    expect_names("deg/h", {"deg/h", "dph", "deg/hr", "deg/hour", "\xC2\xB0/h", "degrees per hour"});
    expect_names("m/s^2", {"m/s^2", "m/s2", "m s^-2", "m/s\xC2\xB2", "m/s/s", "m*s^-2", "meters/second^2"});
    expect_names("ug", {"ug", "\xC2\xB5g", "\xCE\xBCg", "micro-g"});
    expect_names("arcsec", {"arcsec", "arcseconds", "\xE2\x80\xB3"});
    for (const char* unknown : {"", "furlong", "s/deg", "deg/s^2", "m", "deg/deg", "/", "^-1", "()"}) {
        EXPECT_FALSE(find_unit(unknown)) << unknown;
    }
}

TEST(Units, FactorsAreThoseOfTheSi) {
    EXPECT_DOUBLE_EQ(find_unit("mdps")->factor, 3.6);
    EXPECT_DOUBLE_EQ(find_unit("rad/s")->factor, 648000.0 / 3.14159265358979323846);
    EXPECT_DOUBLE_EQ(find_unit("urad/s")->factor * 1e6, find_unit("rad/s")->factor);
    EXPECT_DOUBLE_EQ(find_unit("g")->factor, 9.80665);
    EXPECT_DOUBLE_EQ(find_unit("ug")->factor, 9.80665e-6);
    EXPECT_DOUBLE_EQ(find_unit("ns")->factor, 1e-9);
    EXPECT_EQ(find_unit("ns")->instrument, Instrument::clock);
    EXPECT_EQ(find_unit("mg")->instrument, Instrument::accelerometer);
}

// Every name of the table is found by itself, and is of the kind under which it is listed.
TEST(Units, EveryListedNameIsAUnit) {
    for (const bool is_rate : {false, true}) {
        const std::string all = quantity::known_units(is_rate) + ", ";
        std::size_t found = 0;
        for (std::size_t from = 0; from < all.size();) {
            const std::size_t comma = all.find(", ", from);
            const std::string name = all.substr(from, comma - from);
            const auto unit = find_unit(name);
            ASSERT_TRUE(unit) << name;
            EXPECT_EQ(unit->name, name);
            EXPECT_EQ(unit->is_rate, is_rate);
            ++found;
            from = comma + 2;
        }
        EXPECT_GT(found, 9u);
    }
}

TEST(Units, RatesAndTheirIntegralsAreNotMixed) {
    EXPECT_THAT(complaint_of([] { quantity::unit_for("arcsec", true, "--unit"); }),
                HasSubstr("but the numbers are rates"));
    EXPECT_THAT(complaint_of([] { quantity::unit_for("dps", false, "--unit"); }), HasSubstr("is a unit of rates"));
    EXPECT_THAT(complaint_of([] { quantity::unit_for("furlong", true, "--unit"); }), HasSubstr("deg/h"));
}

TEST(Units, ACountHasASizeWithAUnit) {
    const quantity::Unit count = quantity::unit_of_counts("0.25arcsec", false);
    EXPECT_DOUBLE_EQ(count.factor, 0.25);
    EXPECT_DOUBLE_EQ(quantity::unit_of_counts("1e-3 dps", true).factor, 3.6);
    EXPECT_DOUBLE_EQ(quantity::scaled(*find_unit("deg/s"), "0.5").factor, 1800.0);
    for (const char* wrong : {"", "arcsec", "0arcsec", "-1arcsec", "0.25", "nan arcsec", "1e999arcsec", "0.25dps"}) {
        EXPECT_NE(complaint_of([&] { quantity::unit_of_counts(wrong, false); }), "") << wrong;
    }
    for (const char* wrong : {"0", "-2", "x", "2deg/s"}) {
        EXPECT_NE(complaint_of([&] { quantity::scaled(*find_unit("deg/s"), wrong); }), "") << wrong;
    }
}

TEST(Units, NamesDeclareThem) {
    const auto name_in = [](const char* name) {
        const auto unit = quantity::unit_in_name(name);
        return unit ? unit->name : std::string();
    };
    EXPECT_EQ(name_in("Gyro X (deg/s)"), "deg/s");
    EXPECT_EQ(name_in("w_x [rad s^-1]"), "rad/s");
    EXPECT_EQ(name_in("/samples/angle_increment_arcsec"), "arcsec");
    EXPECT_EQ(name_in("rate_deg_h"), "deg/h");
    EXPECT_EQ(name_in("acc_m_s2"), "m/s^2");
    for (const char* none : {"gx", "gyro_s", "acc_g", "x)", "gyroADC[0]", "", "[]", "a]"})
        EXPECT_EQ(name_in(none), "") << none;
}

TEST(Units, AContradictionNamesBoth) {
    const quantity::Unit given = *find_unit("deg/s");
    const std::string text = complaint_of(
        [&] { quantity::refuse_contradiction("log.csv", "w_x [rad s^-1]", std::nullopt, given, "--unit"); });
    EXPECT_THAT(text, HasSubstr("log.csv"));
    EXPECT_THAT(text, HasSubstr("w_x [rad s^-1]"));
    EXPECT_THAT(text, HasSubstr("rad/s"));
    EXPECT_THAT(text, HasSubstr("--unit deg/s"));
    // A text of the file counts before the name; one that is no unit is not checked.
    EXPECT_NE(complaint_of([&] { quantity::refuse_contradiction("f", "gx", "dph", given, "--unit"); }), "");
    EXPECT_EQ(complaint_of([&] { quantity::refuse_contradiction("f", "gx", "dps", given, "--unit"); }), "");
    EXPECT_EQ(complaint_of([&] { quantity::refuse_contradiction("f", "gx", "LSB", given, "--unit"); }), "");
}

}  // namespace
}  // namespace quantity_units_test
