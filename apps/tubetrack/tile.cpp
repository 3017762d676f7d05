#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "run.hpp"
#include "tubetrack/report/contact_sheet.hpp"

namespace tubetrack {

namespace {

struct TileOptions {
  std::string out;
  std::vector<std::string> pictures;
  int columns = 6;
  int width_px = 480;
};

}  // namespace

// For scripts/contact-sheet; not in the list of commands.
void add_tile(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<TileOptions>();
  CLI::App* command = app.add_subcommand("tile", "put pictures together on one sheet");
  command->group("");
  command->add_option("OUT.png", options->out, "the sheet to write")->required();
  command->add_option("LABEL=PICTURE", options->pictures, "the pictures, each with the text to put on it")->required();
  command->add_option("--columns", options->columns, "pictures in a row");
  command->add_option("--width", options->width_px, "of one picture on the sheet, in pixels");
  command->callback([options, &exit_code] {
    std::vector<LabelledPicture> pictures;
    for (const std::string& text : options->pictures) {
      const std::size_t equals = text.find('=');
      const std::string path = equals == std::string::npos ? text : text.substr(equals + 1);
      pictures.push_back({path, equals == std::string::npos ? "" : text.substr(0, equals)});
    }
    const auto written = write_contact_sheet(options->out, pictures, options->columns, options->width_px);
    exit_code = written ? 0 : report_error(written.error());
  });
}

}  // namespace tubetrack
