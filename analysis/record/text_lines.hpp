#pragma once
#include <functional>
#include <string>
#include <string_view>

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

/// Calls `line` with every line of the file, without its end. Throws InputError where the file cannot be read or a line
/// is longer than any text's.
void for_each_line(const std::string& path, const std::function<void(std::string_view)>& line);

}  // namespace ringlock::record
