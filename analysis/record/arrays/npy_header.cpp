#include "analysis/record/arrays/npy_header.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <utility>

#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::record {
namespace {

/// A literal of Python, as far as heads of .npy files have them.
struct Literal {
    enum class Kind { text, truth, number, list, dictionary } kind = Kind::list;
    std::string text;
    bool truth = false;
    std::uint64_t number = 0;
    std::vector<Literal> items;  ///< of a tuple or list; of a dictionary keys and values in turns
};

class LiteralReader {
   public:
    LiteralReader(std::string_view text, const std::string& where) : rest_(text), where_(where) {}

    Literal all() {
        Literal out = value(0);
        skip_blanks();
        if (!rest_.empty()) fail("goes on behind its dictionary");
        return out;
    }

    [[noreturn]] void fail(const std::string& what) const {
        throw InputError(fmt::format("{}: the head of the array {}; is the file damaged?", where_, what));
    }

   private:
    void skip_blanks() {
        while (!rest_.empty() && (text::is_space(rest_.front()) || rest_.front() == '\n')) rest_.remove_prefix(1);
    }
    bool take(char c) {
        skip_blanks();
        if (rest_.empty() || rest_.front() != c) return false;
        rest_.remove_prefix(1);
        return true;
    }
    bool take(std::string_view word) {
        skip_blanks();
        if (!rest_.starts_with(word)) return false;
        rest_.remove_prefix(word.size());
        return true;
    }

    Literal value(int depth) {
        constexpr int deepest = 16;
        if (depth > deepest) fail("is nested too deeply");
        skip_blanks();
        if (rest_.empty()) fail("ends too early");
        Literal out;
        if (take('{')) return items('}', Literal::Kind::dictionary, depth);
        if (take('(')) return items(')', Literal::Kind::list, depth);
        if (take('[')) return items(']', Literal::Kind::list, depth);
        if (rest_.front() == '\'' || rest_.front() == '"') {
            out.kind = Literal::Kind::text;
            out.text = quoted();
            return out;
        }
        if (take("True") || take("False")) {
            out.kind = Literal::Kind::truth;
            out.truth = *(rest_.data() - 2) == 'u';
            return out;
        }
        const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), out.number);
        if (error != std::errc())
            fail(fmt::format("has '{}' where a value must stand", text::shown(rest_.substr(0, 20))));
        out.kind = Literal::Kind::number;
        rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
        take('L');  // of Python 2
        return out;
    }

    Literal items(char close, Literal::Kind kind, int depth) {
        Literal out;
        out.kind = kind;
        while (!take(close)) {
            out.items.push_back(value(depth + 1));
            if (kind == Literal::Kind::dictionary) {
                if (!take(':')) fail("has a key without a value");
                out.items.push_back(value(depth + 1));
            }
            if (take(',')) continue;
            if (!take(close)) fail(fmt::format("lacks a '{}'", close));
            break;
        }
        return out;
    }

    std::string quoted() {
        const char quote = rest_.front();
        std::string out;
        for (std::size_t i = 1; i < rest_.size(); ++i) {
            if (rest_[i] == '\\' && i + 1 < rest_.size()) {
                out += rest_[++i];
            } else if (rest_[i] == quote) {
                rest_.remove_prefix(i + 1);
                return out;
            } else {
                out += rest_[i];
            }
        }
        fail("has a name without an end");
    }

    std::string_view rest_;
    const std::string& where_;
};

/// "<f8" in a field; `bytes` is its size in an element, whether it is a number or not.
NpyField field_of_type(const std::string& text, const LiteralReader& reader) {
    if (text.size() < 2) reader.fail(fmt::format("has the type '{}'", text::shown(text)));
    NpyField field;
    field.type.big_endian = text[0] == '>';
    field.type.kind = text[1];
    std::size_t bytes = 0;
    const char* last = text.data() + text.size();
    const auto [end, error] = std::from_chars(text.data() + 2, last, bytes);
    const bool measured = error == std::errc();
    constexpr std::size_t largest = std::size_t{1} << 24;
    if (text[1] != 'O' && (!measured || bytes > largest)) {
        reader.fail(fmt::format("has the type '{}'", text::shown(text)));
    }
    field.type.bytes = text[1] == 'U' ? 4 * bytes : text[1] == 'O' && !measured ? 8 : bytes;
    const auto one_of = [&](std::initializer_list<std::size_t> sizes) {
        return std::find(sizes.begin(), sizes.end(), bytes) != sizes.end();
    };
    switch (text[1]) {
        case 'f':
            if (!one_of({2, 4, 8})) field.why_not = "holds numbers of extended precision; write float64";
            break;
        case 'i':
        case 'u':
            if (!one_of({1, 2, 4, 8})) field.why_not = fmt::format("holds integers of {} bytes", bytes);
            break;
        case 'b':
            if (bytes != 1) field.why_not = "holds booleans of several bytes";
            break;
        case 'c':
            field.why_not = "holds complex numbers; write real and imaginary part as arrays of their own";
            break;
        case 'O':
            field.why_not = "holds Python objects, which only Python can read; write numbers (astype(float))";
            break;
        case 'S':
        case 'a':
        case 'U':
            field.why_not = "holds text; write numbers";
            break;
        case 'M':
        case 'm':
            field.why_not = "holds dates or spans of time; write numbers (astype('int64'))";
            break;
        default:
            field.why_not = fmt::format("is of the type '{}'; write numbers", text::shown(text));
    }
    return field;
}

std::uint64_t product(const std::vector<Literal>& sides, const LiteralReader& reader) {
    std::uint64_t all = 1;
    for (const Literal& side : sides) {
        constexpr std::uint64_t largest = std::uint64_t{1} << 24;
        if (side.kind != Literal::Kind::number || side.number > largest || all * side.number > largest) {
            reader.fail("has a field of too many numbers");
        }
        all *= side.number;
    }
    return all;
}

void add_field(NpyHeader& head, const Literal& described, const LiteralReader& reader) {
    const auto& parts = described.items;
    if (described.kind != Literal::Kind::list || parts.size() < 2 || parts.size() > 3) {
        reader.fail("has a field without a name and a type");
    }
    if (parts[0].kind != Literal::Kind::text || parts[1].kind != Literal::Kind::text) {
        reader.fail("has fields within fields or with titles, which this program does not read");
    }
    NpyField field = field_of_type(parts[1].text, reader);
    field.name = parts[0].text;
    field.offset = head.element_bytes;
    std::uint64_t numbers = 1;
    if (parts.size() == 3) {
        const std::vector<Literal> sides =
            parts[2].kind == Literal::Kind::list ? parts[2].items : std::vector<Literal>{parts[2]};
        numbers = product(sides, reader);
        field.count = numbers;
        if (sides.size() != 1 && field.why_not.empty()) field.why_not = "is a field of arrays of several dimensions";
        if (numbers == 0 && field.why_not.empty()) field.why_not = "is a field without numbers";
    }
    head.element_bytes += field.type.bytes * numbers;
    head.fields.push_back(std::move(field));
}

void set_type(NpyHeader& head, const Literal& value, const LiteralReader& reader) {
    if (value.kind == Literal::Kind::text) {
        head.fields.push_back(field_of_type(value.text, reader));
        head.element_bytes = head.fields.back().type.bytes;
    } else if (value.kind == Literal::Kind::list) {
        for (const Literal& field : value.items) add_field(head, field, reader);
    } else {
        reader.fail("has no type");
    }
}

}  // namespace

std::size_t npy_header_bytes(std::string_view preamble, const std::string& where) {
    if (preamble.size() < npy_preamble_bytes || !preamble.starts_with(npy_magic)) {
        throw InputError(fmt::format("{}: is not an array of NumPy, or is cut off in its head", where));
    }
    const auto byte = [&](std::size_t i) { return static_cast<std::size_t>(static_cast<unsigned char>(preamble[i])); };
    const std::size_t version = byte(6);
    if (version < 1 || version > 3) {
        throw InputError(
            fmt::format("{}: is an array of version {} of the .npy format; this program reads 1 to 3", where, version));
    }
    if (version == 1) return 10 + byte(8) + 256 * byte(9);
    const std::size_t length = byte(8) + (byte(9) << 8U) + (byte(10) << 16U) + (byte(11) << 24U);
    constexpr std::size_t longest = std::size_t{1} << 20;
    if (length > longest) {
        throw InputError(
            fmt::format("{}: has a head of {} bytes, longer than any array's; is the file damaged?", where, length));
    }
    return 12 + length;
}

NpyHeader parse_npy_header(std::string_view bytes, const std::string& where) {
    const std::size_t all = npy_header_bytes(bytes.substr(0, npy_preamble_bytes), where);
    if (bytes.size() < all) throw InputError(fmt::format("{}: is cut off in its head", where));
    const std::size_t begin = bytes[6] == 1 ? 10 : 12;
    LiteralReader reader(bytes.substr(begin, all - begin), where);
    const Literal dictionary = reader.all();
    if (dictionary.kind != Literal::Kind::dictionary) reader.fail("is not a dictionary");
    NpyHeader head;
    head.bytes = all;
    bool has_order = false;
    bool has_shape = false;
    for (std::size_t i = 0; i + 1 < dictionary.items.size(); i += 2) {
        const std::string& key = dictionary.items[i].text;
        const Literal& value = dictionary.items[i + 1];
        if (key == "descr" && head.fields.empty()) set_type(head, value, reader);
        if (key == "fortran_order") {
            has_order = value.kind == Literal::Kind::truth;
            head.column_by_column = value.truth;
        }
        if (key == "shape" && value.kind == Literal::Kind::list && !has_shape) {
            has_shape = true;
            for (const Literal& side : value.items) {
                if (side.kind != Literal::Kind::number) reader.fail("has a shape that is not made of numbers");
                head.shape.push_back(side.number);
            }
        }
    }
    if (head.fields.empty() || !has_order || !has_shape) {
        reader.fail("lacks one of its keys descr, fortran_order and shape");
    }
    return head;
}

}  // namespace ringlock::record
