#include "analysis/export/json.hpp"

#include <fmt/format.h>

#include <cmath>
#include <concepts>
#include <nlohmann/json.hpp>

#include "engine/core/json_text.hpp"

namespace ringlock::exports {
namespace {

std::string json_of_text(const std::string& text) { return json_text(nlohmann::json(text)); }

/// Shortest text that reads back as the same number, and as a real one.
std::string json_of_real(double value) {
    if (!std::isfinite(value)) return "null";
    std::string text = fmt::format("{}", value);
    if (text.find_first_of(".e") == std::string::npos) text += ".0";
    return text;
}

template <class T>
std::string json_of_element(const T& value) {
    if constexpr (std::same_as<T, std::string>) return json_of_text(value);
    if constexpr (std::same_as<T, double>) return json_of_real(value);
    if constexpr (std::integral<T>)
        return fmt::format("{}",
                           static_cast<std::conditional_t<std::is_signed_v<T>, std::int64_t, std::uint64_t>>(value));
}

std::string json_of_attribute(const store::AttributeValue& value) {
    return std::visit(
        []<class T>(const T& v) -> std::string {
            if constexpr (std::same_as<T, std::vector<double>>) {
                std::string out;
                for (const double number : v) out += (out.empty() ? "" : ", ") + json_of_real(number);
                return "[" + out + "]";
            } else {
                return json_of_element(v);
            }
        },
        value);
}

class JsonExport {
   public:
    JsonExport(const store::File& file, const std::vector<store::ListedObject>& objects, const Sink& sink)
        : file_(file), objects_(objects), out_(sink) {}

    void write() {
        write_object(0);
        out_ += "\n";
        out_.flush();
    }

   private:
    /// Writes an object with all that lies in it, and returns the number of the next one.
    std::size_t write_object(std::size_t number) {
        const store::ListedObject& object = objects_[number];
        out_ += "{";
        ++depth_;
        bool is_first = true;
        write_attributes(object, is_first);
        std::size_t next = number + 1;
        if (object.is_dataset) {
            write_values(object, is_first);
        } else {
            const std::string inside = object.path == "/" ? "/" : object.path + "/";
            while (next < objects_.size() && objects_[next].path.starts_with(inside)) {
                begin_member(objects_[next].name(), is_first);
                next = write_object(next);
            }
        }
        --depth_;
        if (!is_first) end_line();
        out_ += "}";
        return next;
    }

    void write_attributes(const store::ListedObject& object, bool& is_first) {
        if (object.attributes.empty()) return;
        begin_member("attributes", is_first);
        out_ += "{";
        ++depth_;
        bool first_attribute = true;
        for (const store::ListedAttribute& attribute : object.attributes) {
            begin_member(attribute.name, first_attribute);
            out_ += json_of_attribute(attribute.value);
        }
        --depth_;
        end_line();
        out_ += "}";
    }

    void write_values(const store::ListedObject& dataset, bool& is_first) {
        begin_member("unit", is_first);
        out_ += json_of_text(dataset.unit);
        begin_member("description", is_first);
        out_ += json_of_text(dataset.description);
        begin_member("values", is_first);
        if (!dataset.shape.empty()) out_ += "[";
        ++depth_;
        each_block(file_, dataset, [&](const store::Values& values, std::uint64_t first_row, std::uint64_t rows) {
            std::visit([&](const auto& v) { write_rows(dataset, v, first_row, rows); }, values);
        });
        --depth_;
        if (!dataset.shape.empty()) out_ += "]";
    }

    template <class T>
    void write_rows(const store::ListedObject& dataset, const std::vector<T>& values, std::uint64_t first_row,
                    std::uint64_t rows) {
        const std::uint64_t columns = dataset.columns();
        for (std::uint64_t r = 0; r < rows; ++r) {
            const bool in_rows = dataset.shape.size() == 2;
            if (first_row + r > 0) out_ += in_rows ? "," : ", ";
            if (in_rows) end_line();
            if (in_rows) out_ += "[";
            for (std::uint64_t c = 0; c < columns; ++c) {
                if (c > 0) out_ += ", ";
                out_ += json_of_element<T>(values[r * columns + c]);
            }
            if (in_rows) out_ += "]";
        }
    }

    void begin_member(const std::string& name, bool& is_first) {
        if (!is_first) out_ += ",";
        is_first = false;
        end_line();
        out_ += json_of_text(name);
        out_ += ": ";
    }

    void end_line() {
        out_ += "\n";
        for (int i = 0; i < depth_; ++i) out_ += "  ";
    }

    const store::File& file_;
    const std::vector<store::ListedObject>& objects_;
    Collected out_;
    int depth_ = 0;
};

}  // namespace

void write_json(const store::File& file, const std::vector<store::ListedObject>& objects, const Sink& sink) {
    JsonExport(file, objects, sink).write();
}

}  // namespace ringlock::exports
