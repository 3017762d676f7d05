#pragma once

#include <string>

namespace tubetrack::bench {

/// What a page says of the run that made it.
struct AboutRun {
  std::string command;
  std::string commit = "unknown";
  std::string cpu = "unknown";
};

/// Title, and a table of the run, in Markdown.
std::string page_head(const std::string& title, const AboutRun& about);

}  // namespace tubetrack::bench
