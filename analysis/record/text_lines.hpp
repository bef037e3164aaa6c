#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <system_error>

/// Lines, fields and numbers of text files.
namespace ringlock::record {

bool is_space(char c);

/// Without white space at either end.
std::string_view trimmed(std::string_view s);

/// The fields of one row, one after the other. White space around fields never counts; an empty field between commas
/// does.
class Fields {
   public:
    Fields(std::string_view row, bool commas) : rest_(row), commas_(commas) {}

    bool next(std::string_view& field);

   private:
    std::string_view rest_;
    bool commas_;
    bool done_ = false;
};

/// A number in plain notation, of the whole field.
bool parse_number(std::string_view field, double& value);

/// A whole number of digits alone. errc() where it is one; result_out_of_range where 64 bits do not hold it.
std::errc parse_whole_number(std::string_view field, std::int64_t& value);

/// Text of a file as it may stand in a message.
std::string shown(std::string_view text);

/// The path that stands for standard input, and how messages call a file.
inline constexpr std::string_view standard_input = "-";
std::string name_of_file(const std::string& path);

/// Calls `line` with every line of the file, without its end. Throws InputError where the file cannot be read or a line
/// is longer than any text's, Interrupted where the user wants no more.
void for_each_line(const std::string& path, const std::function<void(std::string_view)>& line);

}  // namespace ringlock::record
