#include "page_head.hpp"

#include <fmt/format.h>

#include "markdown.hpp"

namespace tubetrack::bench {

std::string page_head(const std::string& title, const AboutRun& about) {
  return fmt::format(
      "# {}\n\nWritten by `{}`; don't edit.\n\n| | |\n| --- | --- |\n| commit | {} |\n| compiler | {} |\n| CPU | {} "
      "|\n\n",
      title, about.command, about.commit, compiler(), about.cpu);
}

}  // namespace tubetrack::bench
