#include "tubetrack/tracker/block_table.hpp"

#include <algorithm>

namespace tubetrack {

void BlockTable::insert(const VoxelIndex& key, std::int32_t block) {
  if (2 * (size_ + 1) > slots_.size()) {
    std::vector<std::int32_t> old(2 * slots_.size(), kNone);
    old.swap(slots_);
    for (const std::int32_t known : old) {
      if (known != kNone) slots_[slot_of(key_of(known))] = known;
    }
  }
  const auto at = static_cast<std::size_t>(block);
  if (at >= keys_.size()) keys_.resize(at + 1);
  keys_[at] = key;
  slots_[slot_of(key)] = block;
  ++size_;
}

void BlockTable::erase(const VoxelIndex& key) {
  const std::size_t mask = slots_.size() - 1;
  std::size_t gap = slot_of(key);
  // Those behind it move up, so that none is cut off from where a search for it begins.
  for (std::size_t at = (gap + 1) & mask; slots_[at] != kNone; at = (at + 1) & mask) {
    if (((at - home_of(key_of(slots_[at]))) & mask) < ((at - gap) & mask)) continue;
    slots_[gap] = slots_[at];
    gap = at;
  }
  slots_[gap] = kNone;
  --size_;
}

void BlockTable::clear() {
  std::fill(slots_.begin(), slots_.end(), kNone);
  size_ = 0;
}

}  // namespace tubetrack
