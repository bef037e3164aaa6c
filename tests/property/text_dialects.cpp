// Tables written in every dialect come back as they were.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "analysis/record/series/series.hpp"
#include "engine/core/notice.hpp"
#include "tests/support/packed_text.hpp"
#include "tests/support/temporary_directory.hpp"

namespace ringlock::test {
namespace text_dialects_test {
namespace {

/// What a table is, however it is written.
struct Values {
    std::vector<std::string> names, units;
    std::vector<std::vector<double>> rows;  ///< NaN where missing
};

class Writer {
   public:
    explicit Writer(std::uint64_t seed) : engine_(seed) {}

    std::size_t any(std::size_t below) { return engine_() % below; }
    bool coin() { return any(2) == 0; }
    template <class T>
    T one_of(const std::vector<T>& of) {
        return of[any(of.size())];
    }

    Values values() {
        Values out;
        const std::size_t columns = 2 + any(4);
        const std::vector<std::string> stems = {"Gyro X", "w_x", "acc", "Temp. 2", "µ", "gyro[0]", "t"};
        for (std::size_t k = 0; k < columns; ++k) {
            out.names.push_back(fmt::format("{}{}", one_of(stems), k));
            out.units.push_back(one_of<std::string>({"deg/s", "rad s^-1", "s", "m/s^2", "g"}));
        }
        const std::size_t rows = 3 + any(60);
        for (std::size_t i = 0; i < rows; ++i) {
            std::vector<double> row;
            for (std::size_t k = 0; k < columns; ++k) {
                const double mantissa = std::uniform_real_distribution<double>(-1.0, 1.0)(engine_);
                const bool missing = i > 0 && any(12) == 0;
                row.push_back(missing ? std::numeric_limits<double>::quiet_NaN()
                                      : std::ldexp(mantissa, static_cast<int>(any(40)) - 20));
            }
            out.rows.push_back(row);
        }
        return out;
    }

    std::string text(const Values& values) {
        delimiter_ = one_of<std::string>({",", ";", "\t", " ", " , ", "; "});
        comma_ = delimiter_.find(',') == std::string::npos && coin();
        quotes_ = coin();
        end_ = one_of<std::string>({"\n", "\r\n", "\r"});
        std::string out = preamble();
        const bool named = coin();
        if (named) out += header(values);
        named_ = named;
        for (const auto& row : values.rows) {
            std::string line;
            for (std::size_t k = 0; k < row.size(); ++k) line += (k > 0 ? delimiter_ : "") + cell(row[k]);
            if (delimiter_.find_first_not_of(' ') != std::string::npos && any(10) == 0) line += " # a note";
            out += line + end_;
            if (any(15) == 0) out += one_of<std::string>({"", "# in between", "  "}) + end_;
        }
        if (coin()) out.resize(out.size() - end_.size());
        return out;
    }

    bool named() const { return named_; }

   private:
    bool blank() const { return delimiter_ == " "; }

    std::string preamble() {
        std::string out;
        const std::size_t lines = coin() ? 0 : any(40);
        const std::string mark = one_of<std::string>({"# ", "// ", "% "});
        for (std::size_t i = 0; i < lines; ++i) out += fmt::format("{}Setting {} = unknown{}", mark, i, end_);
        return out;
    }

    std::string header(const Values& values) {
        const bool units_below = coin();
        const bool commented = any(4) == 0;
        std::string names, units;
        for (std::size_t k = 0; k < values.names.size(); ++k) {
            std::string name = values.names[k];
            if (!units_below) name += fmt::format(" {}", bracketed(values.units[k]));
            const std::string unit = bracketed(values.units[k]);
            // Blanks in names want quotes where blanks part columns.
            const bool wants = (blank() && name.find(' ') != std::string::npos) || quotes_;
            names += (k > 0 ? delimiter_ : "") + (wants ? quoted(name) : name);
            units += (k > 0 ? delimiter_ : "") + (blank() ? quoted(unit) : unit);
        }
        return (commented ? "#" : "") + names + end_ + (units_below ? units + end_ : "");
    }

    std::string bracketed(const std::string& unit) { return coin() ? "[" + unit + "]" : "(" + unit + ")"; }
    static std::string quoted(const std::string& text) { return "\"" + text + "\""; }

    std::string cell(double value) {
        if (std::isnan(value)) {
            const std::string word =
                one_of<std::string>({"nan", "NaN", "-nan", "NA", "N/A", "null", "1.#QNAN", "-1.#IND00", "", "--"});
            return word.empty() && blank() ? "nan" : word;
        }
        std::string text = fmt::format("{:.17g}", value);
        if (any(8) == 0) text = fmt::format("{:.17e}", value);
        if (const auto e = text.find('e'); e != std::string::npos && coin()) text[e] = 'D';
        if (comma_) {
            if (const auto point = text.find('.'); point != std::string::npos) text[point] = ',';
        }
        return quotes_ && coin() ? quoted(text) : text;
    }

    std::mt19937_64 engine_;
    std::string delimiter_, end_ = "\n";
    bool comma_ = false, quotes_ = false, named_ = false;
};

TEST(TextDialects, TablesComeBackAsTheyWereWritten) {
    const TemporaryDirectory directory;
    set_notice_sink([](std::string_view) {});
    const std::string path = (directory / "table").string();
    for (std::uint64_t seed = 0; seed < 400; ++seed) {
        Writer writer(seed);
        const Values values = writer.values();
        const std::string plain = writer.text(values);
        const bool wide = writer.any(4) == 0;
        const std::string encoded = wide ? utf16(plain, writer.coin(), true) : plain;
        const auto packer = static_cast<Packer>(writer.any(4));
        std::ofstream(path, std::ios::binary) << packed(encoded, packer);
        for (std::size_t k = 0; k < values.names.size(); ++k) {
            record::SeriesRequest request;
            request.path = path;
            request.column = writer.named() && writer.coin() ? values.names[k] : std::to_string(k + 1);
            record::Series series;
            try {
                series = record::read_series(request);
            } catch (const std::exception& error) {
                std::size_t there = 0;
                for (const auto& row : values.rows) there += std::isnan(row[k]) ? 0 : 1;
                EXPECT_EQ(there, 0u) << seed << ": " << error.what() << "\n" << plain;
                continue;
            }
            ASSERT_EQ(series.n, values.rows.size()) << seed << " column " << k << "\n" << plain;
            for (std::size_t i = 0; i < series.n; ++i) {
                const double expected = values.rows[i][k];
                ASSERT_TRUE(series.values[i] == expected || (std::isnan(expected) && std::isnan(series.values[i])))
                    << seed << " column " << k << " row " << i << ": " << series.values[i] << "\n"
                    << plain;
            }
            EXPECT_EQ(series.unit.value_or(""), writer.named() ? values.units[k] : "") << seed << "\n" << plain;
        }
        if (HasFailure()) break;
    }
    set_notice_sink({});
}

}  // namespace
}  // namespace text_dialects_test
}  // namespace ringlock::test
