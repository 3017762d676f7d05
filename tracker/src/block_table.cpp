#include "tubetrack/tracker/block_table.hpp"

#include <algorithm>

namespace tubetrack {

void BlockTable::insert(const VoxelIndex& key, std::int32_t block) {
  if (2 * (size_ + 1) > slots_.size()) {
    std::vector<Slot> old(2 * slots_.size());
    old.swap(slots_);
    for (const Slot& slot : old) {
      if (slot.block != kNone) slots_[slot_of(slot.key)] = slot;
    }
  }
  slots_[slot_of(key)] = {key, block};
  ++size_;
}

void BlockTable::erase(const VoxelIndex& key) {
  const std::size_t mask = slots_.size() - 1;
  std::size_t gap = slot_of(key);
  // Those behind it move up, so that none is cut off from where a search for it begins.
  for (std::size_t at = (gap + 1) & mask; slots_[at].block != kNone; at = (at + 1) & mask) {
    if (((at - home_of(slots_[at].key)) & mask) < ((at - gap) & mask)) continue;
    slots_[gap] = slots_[at];
    gap = at;
  }
  slots_[gap] = {};
  --size_;
}

void BlockTable::clear() {
  std::fill(slots_.begin(), slots_.end(), Slot{});
  size_ = 0;
}

}  // namespace tubetrack
