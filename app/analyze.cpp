#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "analysis/report/plot.hpp"
#include "analysis/study/family.hpp"
#include "analysis/study/result_file.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/output.hpp"
#include "app/study_output.hpp"

namespace ringlock::app {

void add_analyze(CLI::App& root) {
    struct Arguments {
        std::string file;
        std::string plot;
        std::string dev;
        bool json = false;
    };
    CLI::App* command =
        root.add_subcommand("analyze", "Compare the arms of a result: Allan deviation, noise, rate error");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("OUT.h5", arguments->file, "result of ringlock run")->required();
    command->add_option("--dev", arguments->dev,
                        "also these deviations of the angle records, comma between: " + known_deviations());
    command->add_option("--plot", arguments->plot, "also draw the figure into this SVG file");
    command->add_flag("--json", arguments->json, "print one JSON object instead of a table");
    command->callback([arguments] {
        check_figure(arguments->plot);
        const auto asked = arguments->dev.empty() ? std::vector<allan::Estimator>{} : parse_deviations(arguments->dev);
        const study::Study study = study::read_result(arguments->file);
        const store::Provenance provenance = study::read_provenance(arguments->file);
        study::Summary summary = study::summarise(study);
        if (!asked.empty()) {
            auto family = study::family_deviations(arguments->file, study, asked);
            for (std::size_t i = 0; i < family.size(); ++i) summary.arms[i].family = std::move(family[i]);
        }
        if (!arguments->plot.empty()) report::write_svg(arguments->plot, study_figure(study, summary));
        put(arguments->json ? study_json(study, summary, provenance) : study_text(study, summary, provenance));
    });
}

}  // namespace ringlock::app
