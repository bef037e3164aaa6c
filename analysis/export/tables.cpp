#include "analysis/export/tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "analysis/export/csv.hpp"
#include "engine/core/error.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock::exports {
namespace {

using From = Cells::From;
using Object = store::ListedObject;

/// Rows of this length and below become columns; longer ones lines of their own.
constexpr std::uint64_t most_elements_as_columns = 16;

std::string parent_of(const std::string& path) {
    const std::size_t slash = path.rfind('/');
    return slash == 0 ? "/" : path.substr(0, slash);
}

/// As names of datasets have a unit: "deg_rt_h" of "deg/sqrt(h)".
std::string unit_in_names(const std::string& unit) {
    std::string out;
    for (const char c : unit) {
        if (c == '(' || c == ')' || c == '^') continue;
        out += c == '/' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
    for (std::size_t at = 0; (at = out.find("sqrt", at)) != std::string::npos;) out.replace(at, 4, "rt_");
    return out;
}

/// The name of a column: that of the dataset, with its unit where the name has none.
std::string header_of(const Object& dataset, const std::string& name) {
    const std::string unit = unit_in_names(dataset.unit);
    const bool is_plain = unit.empty() || unit == "1";
    const bool has_it = name.find("_" + unit) != std::string::npos ||
                        (unit == "degc" && name.find("temperature_c") != std::string::npos);
    return is_plain || has_it ? name : fmt::format("{} [{}]", name, dataset.unit);
}

/// Orders a figure before its limits, and the lower one before the upper: "deviation_lo_deg_h" follows
/// "deviation_deg_h".
std::string sorting_name(const std::string& name) {
    for (const auto& [limit, place] : {std::pair{std::string("_lo"), " 1"}, {std::string("_hi"), " 2"}}) {
        for (std::size_t at = 0; (at = name.find(limit, at)) != std::string::npos; at += limit.size()) {
            const std::string rest = name.substr(at + limit.size());
            if (rest.empty() || rest.starts_with('_')) return name.substr(0, at) + rest + place;
        }
    }
    return name;
}

std::string text_of(const store::AttributeValue& value) {
    return std::visit(
        []<class T>(const T& v) -> std::string {
            if constexpr (std::same_as<T, std::string>) {
                return cell_of(v);
            } else if constexpr (std::same_as<T, std::vector<double>>) {
                std::string out;
                for (const double number : v) out += fmt::format("{}{}", out.empty() ? "" : " ", number);
                return out;
            } else if constexpr (std::same_as<T, double>) {
                return std::isnan(v) ? "" : fmt::format("{}", v);
            } else {
                return fmt::format("{}", v);
            }
        },
        value);
}

/// Order of tables: those of the rows that a file is made for, others, the scenario.
int place_of(const std::string& table) {
    if (table == "gyros" || table == "turns" || table == "samples" || table == "parameters") return 0;
    return table == "scenario" ? 2 : 1;
}

/// A table whose parts may have different columns: each is added where it first occurs.
class TableMaker {
   public:
    TableMaker(std::string name, std::string content) {
        table_.name = std::move(name);
        table_.content = std::move(content);
    }
    void begin_part(std::uint64_t rows, std::uint64_t inner = 1) {
        table_.parts.push_back({rows, inner, std::vector<Cells>(table_.header.size())});
    }
    void add(const std::string& header, Cells cells) {
        auto found = std::find(table_.header.begin(), table_.header.end(), header);
        const auto number = static_cast<std::size_t>(found - table_.header.begin());
        if (found == table_.header.end()) {
            table_.header.push_back(header);
            for (TablePart& part : table_.parts) part.columns.emplace_back();
        }
        table_.parts.back().columns[number] = std::move(cells);
    }
    bool has(const std::string& header) const {
        return std::find(table_.header.begin(), table_.header.end(), header) != table_.header.end();
    }
    bool is_empty() const { return table_.parts.empty(); }
    Table take() { return std::move(table_); }

   private:
    Table table_;
};

class TablesOfFile {
   public:
    TablesOfFile(const store::File& file, const std::vector<Object>& objects) : file_(file), objects_(objects) {
        for (const Object& object : objects) by_path_.emplace(object.path, &object);
    }

    std::vector<Table> all() {
        const std::string format = text_attribute("/", "format");
        if (format == "ringlock-result") tables_of_result();
        if (format == "ringlock-replay") table_of_turns();
        for (const Object& object : objects_) {
            if (!object.is_dataset) table_of_group(object.path);
        }
        // What a record or the closed loop is about comes first, the text of a scenario last.
        std::stable_sort(tables_.begin(), tables_.end(),
                         [](const Table& a, const Table& b) { return place_of(a.name) < place_of(b.name); });
        add_attributes();
        return std::move(tables_);
    }

   private:
    const Object* find(const std::string& path) const {
        const auto found = by_path_.find(path);
        return found == by_path_.end() ? nullptr : found->second;
    }
    std::string text_attribute(const std::string& path, const std::string& name) const {
        const Object* object = find(path);
        if (object == nullptr) return "";
        for (const store::ListedAttribute& attribute : object->attributes) {
            const auto* text = std::get_if<std::string>(&attribute.value);
            if (attribute.name == name && text != nullptr) return *text;
        }
        return "";
    }
    double number_attribute(const std::string& path, const std::string& name) const {
        const Object* object = find(path);
        if (object == nullptr) return std::nan("");
        for (const store::ListedAttribute& attribute : object->attributes) {
            const auto* number = std::get_if<double>(&attribute.value);
            if (attribute.name == name && number != nullptr) return *number;
        }
        return std::nan("");
    }
    std::vector<double> numbers(const std::string& path) const {
        const Object* dataset = find(path);
        if (dataset == nullptr || dataset->kind != store::ElementKind::real) return {};
        return std::get<std::vector<double>>(store::read_values(file_, *dataset));
    }
    /// Datasets that lie in the group itself and stand in no table yet.
    std::vector<const Object*> members(const std::string& group) const {
        std::vector<const Object*> out;
        for (const Object& object : objects_) {
            const bool is_new = object.is_dataset && !used_.contains(object.path);
            if (is_new && parent_of(object.path) == group) out.push_back(&object);
        }
        std::stable_sort(out.begin(), out.end(), [](const Object* a, const Object* b) {
            return sorting_name(a->name()) < sorting_name(b->name());
        });
        return out;
    }
    /// Arms in the order of the scenario that the result holds, which rows and columns of pairs have; by name where the
    /// scenario cannot be read.
    std::vector<std::string> arms() const {
        std::vector<std::string> by_name;
        for (const Object& object : objects_) {
            if (!object.is_dataset && parent_of(object.path) == "/arms" && object.path != "/arms") {
                by_name.push_back(object.name());
            }
        }
        std::vector<std::string> out;
        for (const std::string& arm : arms_of_scenario_) {
            if (find("/arms/" + arm) != nullptr) out.push_back(arm);
        }
        return out.size() == by_name.size() ? out : by_name;
    }
    void read_arms_of_scenario() {
        const Object* text = find("/scenario");
        if (text == nullptr || text->kind != store::ElementKind::text || text->size() != 1) return;
        const auto values = std::get<std::vector<std::string>>(store::read_values(file_, *text));
        try {
            const auto no_rules = [](const scenario::Scenario&) { return std::vector<scenario::Complaint>(); };
            for (const scenario::Arm& arm : scenario::parse_string(values.at(0), "scenario", {}, no_rules).arms) {
                arms_of_scenario_.push_back(arm.name);
            }
        } catch (const InputError&) {  // of another version of the program, whose keys are not those of this one
            arms_of_scenario_.clear();
        }
    }
    void finish(TableMaker& maker) {
        if (!maker.is_empty()) tables_.push_back(maker.take());
    }
    void use(const Object& dataset) { used_.insert(dataset.path); }

    /// Columns of a dataset whose rows are those of the part: one, or one for each element of its rows.
    void add_by_row(TableMaker& maker, const Object& dataset, const std::string& name,
                    const std::vector<double>& names_of_elements = {}) {
        use(dataset);
        if (dataset.shape.size() < 2) {
            return maker.add(header_of(dataset, name), {.from = From::by_row, .dataset = &dataset});
        }
        for (std::uint64_t i = 0; i < dataset.columns(); ++i) {
            const std::string element = names_of_elements.size() == dataset.columns()
                                            ? fmt::format("{}_after_{}_s", name, names_of_elements[i])
                                            : fmt::format("{}[{}]", name, i);
            maker.add(header_of(dataset, element), {.from = From::element, .dataset = &dataset, .column = i});
        }
    }

    // Results of `ringlock run`.

    void tables_of_result() {
        const Object* rates = find("/gyros/input_rate_deg_h");
        if (rates == nullptr) return;
        read_arms_of_scenario();
        gyros_ = rates->rows();
        const Object* turns = find("/design/turns");
        points_ = turns != nullptr ? std::max<std::uint64_t>(1, turns->rows()) : 1;
        has_design_ = turns != nullptr;
        gyros_of_point_ = std::max<std::uint64_t>(1, gyros_ / points_);
        table_of_gyros();
        table_of_arms();
        if (has_design_) table_of_points();
        table_of_deviations();
        table_of_deviations_of_gyros();
        table_of_angles();
        table_of_pairs();
    }

    void add_gyro(TableMaker& maker) {
        if (has_design_) {
            maker.add("point", {.from = From::row_number, .first = 1, .divisor = gyros_of_point_});
        }
        maker.add("gyro", {.from = From::row_number, .modulus = has_design_ ? gyros_of_point_ : 0});
    }

    void table_of_gyros() {
        TableMaker maker("gyros", "one row for each arm and gyro: its parameters, errors and noise coefficients");
        const std::vector<const Object*> drawn = members("/gyros");
        for (const std::string& arm : arms()) {
            maker.begin_part(gyros_);
            maker.add("arm", {.text = cell_of(arm)});
            add_gyro(maker);
            for (const Object* dataset : drawn) add_by_row(maker, *dataset, dataset->name());
            std::vector<double> times;
            if (const std::string path = "/arms/" + arm + "/angle_error_after_s"; !has_design_) {
                times = numbers(path);
                used_.insert(path);  // its values are in the names of columns
            }
            for (const std::string& group : {"/arms/" + arm, "/arms/" + arm + "/noise"}) {
                for (const Object* dataset : members(group)) {
                    if (dataset->rows() != gyros_ || dataset->name() == "angle_arcsec") continue;
                    if (dataset->name() == "angle_error_after_s") continue;
                    add_by_row(maker, *dataset, dataset->name(), times);
                }
            }
        }
        finish(maker);
    }

    void table_of_arms() {
        TableMaker maker("arms", "one row for each arm: its figures over all gyros");
        for (const std::string& arm : arms()) {
            maker.begin_part(1);
            maker.add("arm", {.text = cell_of(arm)});
            std::vector<store::ListedAttribute> figures = find("/arms/" + arm)->attributes;
            std::stable_sort(figures.begin(), figures.end(),
                             [](const auto& a, const auto& b) { return sorting_name(a.name) < sorting_name(b.name); });
            for (const store::ListedAttribute& attribute : figures) {
                maker.add(attribute.name, {.text = text_of(attribute.value)});
            }
        }
        finish(maker);
    }

    void table_of_points() {
        TableMaker maker("points", "one row for each arm and point of the design: the keys that vary, and the figures");
        std::vector<const Object*> keys = members("/design");
        // Keys of scenarios have a dot in their names; the others are figures of the points.
        std::stable_partition(keys.begin(), keys.end(),
                              [](const Object* d) { return d->name().find('.') != std::string::npos; });
        const std::vector<const Object*> readers = members("/reader");
        for (const std::string& arm : arms()) {
            maker.begin_part(points_);
            maker.add("arm", {.text = cell_of(arm)});
            maker.add("point", {.from = From::row_number, .first = 1});
            for (const auto& group : {keys, readers, members("/arms/" + arm + "/points")}) {
                for (const Object* dataset : group) {
                    if (dataset->rows() == points_) add_by_row(maker, *dataset, dataset->name());
                }
            }
            if (const Object* times = find("/arms/" + arm + "/angle_error_after_s")) {
                if (times->rows() == points_) add_by_row(maker, *times, times->name());
            }
        }
        finish(maker);
    }

    /// Figures of all gyros together, by averaging time.
    static bool is_of_ensemble(const Object& dataset) {
        const std::string name = dataset.name();
        return name.starts_with("ensemble_") || name == "tau_s" || name == "averaging_factor" || name == "terms";
    }

    void table_of_deviations() {
        TableMaker maker("allan", "one row for each arm and averaging time: Allan deviation over all gyros");
        for (const std::string& arm : arms()) {
            const Object* taus = find("/arms/" + arm + "/allan/tau_s");
            if (taus == nullptr) continue;
            const bool by_point = taus->shape.size() == 2;
            maker.begin_part(by_point ? taus->rows() : 1, by_point ? taus->columns() : taus->rows());
            maker.add("arm", {.text = cell_of(arm)});
            if (by_point) maker.add("point", {.from = From::row_number, .first = 1});
            if (!maker.has("tau_s")) maker.add("tau_s", {});
            for (const Object* dataset : members("/arms/" + arm + "/allan")) {
                if (!is_of_ensemble(*dataset) || dataset->shape != taus->shape) continue;
                use(*dataset);
                maker.add(header_of(*dataset, dataset->name()),
                          {.from = by_point ? From::by_both : From::by_column, .dataset = dataset});
            }
        }
        finish(maker);
    }

    void table_of_deviations_of_gyros() {
        TableMaker maker("allan-gyros", "one row for each arm, gyro and averaging time: Allan deviation of that gyro");
        for (const std::string& arm : arms()) {
            const Object* taus = find("/arms/" + arm + "/allan/tau_s");
            if (taus == nullptr) continue;
            const std::uint64_t times = taus->shape.size() == 2 ? taus->columns() : taus->rows();
            maker.begin_part(gyros_, times);
            maker.add("arm", {.text = cell_of(arm)});
            add_gyro(maker);
            maker.add("tau_s", {.from = From::by_column, .dataset = taus, .divisor = gyros_of_point_});
            for (const Object* dataset : members("/arms/" + arm + "/allan")) {
                if (dataset->rows() != gyros_ || dataset->columns() != times) continue;
                use(*dataset);
                maker.add(header_of(*dataset, dataset->name()), {.from = From::by_both, .dataset = dataset});
            }
        }
        finish(maker);
    }

    void table_of_angles() {
        TableMaker maker("angle", "one row for each arm, gyro and sample: the record of the angle");
        std::vector<double> steps = numbers("/design/sample_interval_s");
        if (!has_design_) steps = {number_attribute("/", "sample_interval_s")};
        for (const std::string& arm : arms()) {
            const Object* angle = find("/arms/" + arm + "/angle_arcsec");
            if (angle == nullptr || angle->rows() != gyros_) continue;
            use(*angle);
            maker.begin_part(angle->rows(), angle->columns());
            maker.add("arm", {.text = cell_of(arm)});
            add_gyro(maker);
            if (steps.size() == points_) {
                maker.add("time_s", {.from = From::time, .divisor = gyros_of_point_, .steps = steps});
            }
            maker.add("angle_arcsec", {.from = From::by_both, .dataset = angle});
        }
        finish(maker);
    }

    void table_of_pairs() {
        const std::vector<const Object*> pairs = members("/pairs");
        const std::vector<std::string> names = arms_of_scenario_;
        if (pairs.empty() || names.size() != pairs.front()->columns()) return;
        TableMaker maker("pairs", "one row for each pair of arms: random walk of the first over that of the second");
        const std::uint64_t rows = pairs.front()->rows();
        std::vector<std::string> cells;
        for (const std::string& name : names) cells.push_back(cell_of(name));
        for (std::uint64_t number = 0; number < names.size(); ++number) {
            maker.begin_part(rows);
            if (has_design_) maker.add("point", {.from = From::row_number, .first = 1, .divisor = names.size()});
            maker.add("arm", {.from = From::word, .modulus = names.size(), .words = cells});
            maker.add("over_arm", {.text = cells[number]});
            for (const Object* dataset : pairs) {
                use(*dataset);
                maker.add(dataset->name(), {.from = From::element, .dataset = dataset, .column = number});
            }
        }
        finish(maker);
    }

    // Other files.

    /// All that is said of a turn, by whatever part of the gyro.
    void table_of_turns() {
        const Object* times = find("/turns/time_s");
        if (times == nullptr) return;
        TableMaker maker("turns", "one row for each turn: output, truth, readings, electronics");
        maker.begin_part(times->rows());
        std::map<std::string, int> occurrences;
        const std::vector<std::string> groups = {"turns", "truth", "readings", "hardware"};
        for (const std::string& group : groups) {
            for (const Object* dataset : members("/" + group)) ++occurrences[dataset->name()];
        }
        use(*times);
        maker.add("time_s", {.from = From::by_row, .dataset = times});
        for (const std::string& group : groups) {
            for (const Object* dataset : members("/" + group)) {
                if (dataset->rows() != times->rows()) continue;
                const std::string name = dataset->name();
                add_by_row(maker, *dataset, occurrences[name] > 1 ? fmt::format("{}.{}", group, name) : name);
            }
        }
        finish(maker);
    }

    /// Tables of the other datasets of a group: those of as many rows side by side, long rows one below the other.
    void table_of_group(const std::string& group) {
        const std::string name = group == "/" ? "" : group.substr(1);
        std::vector<std::uint64_t> lengths;
        for (const Object* dataset : members(group)) {
            const bool is_known = std::find(lengths.begin(), lengths.end(), dataset->rows()) != lengths.end();
            if (!is_long(*dataset) && !is_known) lengths.push_back(dataset->rows());
        }
        const auto width = [&](std::uint64_t rows) {
            const auto all = members(group);
            return std::count_if(all.begin(), all.end(),
                                 [&](const Object* d) { return !is_long(*d) && d->rows() == rows; });
        };
        std::stable_sort(lengths.begin(), lengths.end(),
                         [&](std::uint64_t a, std::uint64_t b) { return width(a) > width(b); });
        bool is_first = !name.empty();
        for (const std::uint64_t rows : lengths) {
            std::vector<const Object*> columns;
            for (const Object* dataset : members(group)) {
                if (!is_long(*dataset) && dataset->rows() == rows) columns.push_back(dataset);
            }
            const std::string own =
                name.empty() ? columns.front()->name() : fmt::format("{}/{}", name, columns.front()->name());
            TableMaker maker(is_first ? name : own, content_of(columns));
            is_first = false;
            maker.begin_part(rows);
            for (const Object* dataset : columns) add_by_row(maker, *dataset, dataset->name());
            finish(maker);
        }
        for (const Object* dataset : members(group)) {
            TableMaker maker(dataset->path.substr(1), dataset->description);
            use(*dataset);
            maker.begin_part(dataset->rows(), dataset->columns());
            maker.add("row", {.from = From::row_number});
            maker.add("column", {.from = From::inner_number});
            maker.add(header_of(*dataset, dataset->name()), {.from = From::by_both, .dataset = dataset});
            finish(maker);
        }
    }

    static bool is_long(const Object& dataset) { return dataset.columns() > most_elements_as_columns; }

    static std::string content_of(const std::vector<const Object*>& columns) {
        if (columns.size() == 1) return columns.front()->description;
        std::string out;
        for (const Object* dataset : columns) out += (out.empty() ? "" : ", ") + dataset->name();
        return out;
    }

    void add_attributes() {
        TableMaker maker("attributes", "one row for each attribute of a group or dataset of the file");
        for (const Object& object : objects_) {
            for (const store::ListedAttribute& attribute : object.attributes) {
                maker.begin_part(1);
                maker.add("object", {.text = cell_of(object.path)});
                maker.add("attribute", {.text = cell_of(attribute.name)});
                maker.add("value", {.text = text_of(attribute.value)});
            }
        }
        finish(maker);
    }

    const store::File& file_;
    const std::vector<Object>& objects_;
    std::map<std::string, const Object*> by_path_;
    std::set<std::string> used_;
    std::vector<std::string> arms_of_scenario_;
    std::vector<Table> tables_;
    std::uint64_t gyros_ = 0;
    std::uint64_t points_ = 1;
    std::uint64_t gyros_of_point_ = 1;
    bool has_design_ = false;
};

}  // namespace

std::uint64_t Table::lines() const {
    std::uint64_t out = 0;
    for (const TablePart& part : parts) out += part.rows * part.inner;
    return out;
}

std::vector<Table> tables_of(const store::File& file, const std::vector<store::ListedObject>& objects) {
    return TablesOfFile(file, objects).all();
}

}  // namespace ringlock::exports
