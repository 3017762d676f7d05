#include "faults.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <utility>

namespace tubetrack {

namespace {

/// A fault's word in a script, and the amount it has where the line gives none (NaN: one must be given).
struct FaultWord {
  std::string_view word;
  FaultKind kind;
  double default_amount;
};

const double kNoDefault = std::nan("");

const std::array<FaultWord, 9> kWords = {{{"stall", FaultKind::stall, kNoDefault},
                                          {"unplug", FaultKind::unplug, -1.0},
                                          {"time", FaultKind::time, kNoDefault},
                                          {"clock", FaultKind::clock, kNoDefault},
                                          {"burst", FaultKind::burst, kNoDefault},
                                          {"drop", FaultKind::drop, 1.0},
                                          {"cut", FaultKind::cut, 1.0},
                                          {"hang", FaultKind::hang, kNoDefault},
                                          {"still", FaultKind::still, 1e9}}};

bool counts_frames(FaultKind kind) {
  return kind == FaultKind::burst || kind == FaultKind::drop || kind == FaultKind::cut || kind == FaultKind::still;
}

bool may_be_negative(FaultKind kind) {
  return kind == FaultKind::time || kind == FaultKind::clock || kind == FaultKind::unplug;
}

std::optional<double> number(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value)) return {};
  return value;
}

/// Empty where the line is not `FRAME FAULT [AMOUNT]`.
std::optional<Fault> parse(const std::string& line) {
  std::istringstream in(line);
  std::string frame;
  std::string word;
  std::string amount;
  std::string rest;
  in >> frame >> word >> amount >> rest;
  const auto at = number(frame);
  if (!at || *at < 0.0 || *at != std::floor(*at) || !rest.empty()) return {};
  for (const FaultWord& known : kWords) {
    if (known.word != word) continue;
    const auto given = amount.empty() ? std::optional(known.default_amount) : number(amount);
    if (!given || std::isnan(*given) || (*given < 0.0 && !may_be_negative(known.kind)) || std::abs(*given) > 1e9) {
      return {};
    }
    return Fault{known.kind, *given, static_cast<std::int64_t>(*at)};
  }
  return {};
}

}  // namespace

Expected<std::vector<Fault>> read_fault_script(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) return tl::make_unexpected(Error::usage(fmt::format("{}: the fault script can't be read", path.string())));
  std::vector<Fault> script;
  std::string line;
  for (int number_of_line = 1; std::getline(in, line); ++number_of_line) {
    const std::string text = line.substr(0, line.find('#'));
    if (text.find_first_not_of(" \t\r") == std::string::npos) continue;
    const auto fault = parse(text);
    if (!fault) {
      return tl::make_unexpected(Error::usage(
          fmt::format("{}:{}: got '{}', takes FRAME stall|unplug|time|clock|burst|drop|cut|hang|still AMOUNT",
                      path.string(), number_of_line, line)));
    }
    if (!script.empty() && fault->frame < script.back().frame) {
      return tl::make_unexpected(
          Error::usage(fmt::format("{}:{}: frame {} comes after frame {}; takes frames in rising order", path.string(),
                                   number_of_line, fault->frame, script.back().frame)));
    }
    script.push_back(*fault);
  }
  return script;
}

std::optional<Fault> fault_of_command(int id, std::int32_t value) {
  if (id < kFirstFaultCommand || id > fault_command(FaultKind::still)) return {};
  const auto kind = static_cast<FaultKind>(id - kFirstFaultCommand);
  return Fault{kind, counts_frames(kind) ? value : value * 1e-3, 0};
}

void Faults::order(const Fault& fault) {
  const std::lock_guard lock(mutex_);
  apply(fault);
}

FaultTurn Faults::next_turn() {
  const std::lock_guard lock(mutex_);
  while (at_ < script_.size() && script_[at_].frame <= frame_) apply(script_[at_++]);
  ++frame_;
  FaultTurn turn = std::exchange(next_, {});
  turn.time_shift_s += clock_shift_s_;
  const auto take_one = [](int& left) {
    if (left <= 0) return false;
    --left;
    return true;
  };
  turn.at_once = take_one(burst_left_);
  turn.drop = take_one(drop_left_);
  turn.cut = take_one(cut_left_);
  turn.still = take_one(still_left_);
  return turn;
}

double Faults::take_hang_s() {
  const std::lock_guard lock(mutex_);
  return std::exchange(hang_s_, 0.0);
}

void Faults::apply(const Fault& fault) {
  switch (fault.kind) {
    case FaultKind::stall:
      next_.stall_s += fault.amount;
      break;
    case FaultKind::unplug:
      next_.unplug_for_s = fault.amount;
      break;
    case FaultKind::replug:
      break;  // the cable's affair, not a frame's
    case FaultKind::time:
      next_.time_shift_s += fault.amount;
      break;
    case FaultKind::clock:
      clock_shift_s_ += fault.amount;
      break;
    case FaultKind::burst:
      burst_left_ = static_cast<int>(fault.amount);
      break;
    case FaultKind::drop:
      drop_left_ = static_cast<int>(fault.amount);
      break;
    case FaultKind::cut:
      cut_left_ = static_cast<int>(fault.amount);
      break;
    case FaultKind::hang:
      hang_s_ = fault.amount;
      break;
    case FaultKind::still:
      still_left_ = static_cast<int>(fault.amount);
      break;
  }
}

}  // namespace tubetrack
