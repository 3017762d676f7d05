#include "parse_problem.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "tubetrack/report/nearest_name.hpp"

namespace tubetrack {

namespace {

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* command) { return !command->get_group().empty(); });
}

std::string what_is_near(const std::string& typed, const std::vector<std::string>& known, std::string_view dashes) {
  const auto nearest = nearest_name(typed, known);
  return nearest ? fmt::format(", the nearest is {}{}", dashes, *nearest) : "";
}

std::string unknown_command(const CLI::App& app, const std::string& typed) {
  std::vector<std::string> known;
  for (const CLI::App* command : commands_of(app)) known.push_back(command->get_name());
  return fmt::format("{}: no such command{}", typed, what_is_near(typed, known, ""));
}

std::string unknown_flag(const CLI::App& app, const CLI::App& chosen, const std::string& typed) {
  if (chosen.get_option_no_throw(typed) != nullptr)
    return fmt::format("{}: stands where no flag is read; put it right behind {}", typed, chosen.get_name());
  std::vector<std::string> others, known;
  for (const CLI::App* command : commands_of(app)) {
    if (command->get_option_no_throw(typed) != nullptr) others.push_back(command->get_name());
  }
  if (!others.empty()) return fmt::format("{}: is a flag of {} alone", typed, fmt::join(others, ", "));
  for (const CLI::Option* option : chosen.get_options()) {
    known.insert(known.end(), option->get_lnames().begin(), option->get_lnames().end());
  }
  const std::size_t name = std::min(typed.find_first_not_of('-'), typed.size());
  return fmt::format("{}: no such flag{}", typed, what_is_near(typed.substr(name), known, "--"));
}

/// What was left over: the first flag of it, as the others may be its values.
std::string unexpected(const CLI::App& app, const CLI::App* chosen, const std::vector<std::string>& left_over) {
  const auto flag =
      std::ranges::find_if(left_over, [](const std::string& text) { return text.size() > 1 && text.front() == '-'; });
  if (flag != left_over.end()) return unknown_flag(app, chosen ? *chosen : app, flag->substr(0, flag->find('=')));
  if (chosen == nullptr) return unknown_command(app, left_over.front());
  return fmt::format("{}: one argument too many", left_over.front());
}

/// The option that CLI11's message names; null where it names none.
const CLI::Option* option_in(const CLI::App& command, const std::string& message) {
  for (const CLI::Option* option : command.get_options()) {
    const std::string name = option->get_name();
    if (message.starts_with(name + ":") || message.starts_with("Could not convert: " + name + " =")) return option;
  }
  return nullptr;
}

std::string wrong_value(const CLI::Option& option, bool is_missing) {
  const std::string name = option.get_name(), type = option.get_type_name();
  if (option.get_items_expected_max() == 0) return name + ": takes no value";
  const std::string takes = type == "INT"     ? "a whole number"
                            : type == "UINT"  ? "a whole number, 0 or above"
                            : type == "FLOAT" ? "a number"
                                              : type;
  if (is_missing) return fmt::format("{}: its value is missing, takes {}", name, takes);
  if (option.results().size() > 1)
    return fmt::format("{}: is given {} times, takes {} once", name, option.results().size(), takes);
  return fmt::format("{} {}: takes {}", name, option.results().front(), takes);
}

}  // namespace

std::string parse_problem(const CLI::App& app, const CLI::ParseError& problem) {
  const auto given = app.get_subcommands();
  const CLI::App* const chosen = given.empty() ? nullptr : given.front();
  std::string text = problem.what();
  const std::vector<std::string> left_over = app.remaining(true);
  const CLI::Option* const option = option_in(chosen ? *chosen : app, text);
  if (option != nullptr) {
    const bool is_missing = option->results().empty() || text.ends_with("missing");
    text = wrong_value(*option, is_missing);
  } else if (!left_over.empty()) {
    text = unexpected(app, chosen, left_over);
  }
  return fmt::format("{}; see tubetrack{}{} --help", text, chosen ? " " : "", chosen ? chosen->get_name() : "");
}

}  // namespace tubetrack
