#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "src/messages.hpp"

namespace fiducap::sdk {

/// Records which parts of one list have arrived.
class PartList {
 public:
  void start(const PartPlace& place);
  /// @return false for a part that is present already, or that contradicts the first one
  bool add(const PartPlace& place, std::size_t bodies);
  /// All parts are there.
  bool complete() const { return count_ > 0 && seen_.count() == count_; }
  /// All parts together hold as many bodies as the list.
  bool consistent() const { return bodies_ == body_count_; }

 private:
  std::bitset<kMaxParts> seen_;
  std::uint32_t count_{0};
  std::uint32_t body_count_{0};
  std::size_t bodies_{0};
};

/// Assembles models and frames from their parts. Keeps at most two unfinished frames, for parts out
/// of order; drops parts that are older than a finished frame. Bounded memory.
class FrameAssembler {
 public:
  /// For a restarted server: resets numbers and names.
  void begin(std::uint64_t session);
  void add(const ModelPart& part);
  /// Ignores frames of another session or of an incomplete model.
  /// @return the frame that this part completes, valid until the next call; else nullptr
  Frame* add(const FramePart& part);

  /// Generation of the complete model; 0: none.
  std::uint64_t model_generation() const { return generation_; }
  /// Gaps in the numbers of finished frames of this session.
  std::uint64_t lost() const { return lost_; }
  std::uint64_t received() const { return received_; }

 private:
  struct Unfinished {
    std::uint64_t number{0};  ///< 0: free.
    std::uint64_t step{1};
    PartList parts;
    Frame frame;
  };
  Unfinished* place_for(const FramePart& part);
  bool put(const FramePart& part, Frame& frame) const;

  std::uint64_t session_{0};
  std::uint64_t generation_{0};
  std::vector<std::pair<int, std::string>> model_;
  std::uint64_t next_generation_{0};
  PartList next_parts_;
  std::vector<std::pair<int, std::string>> next_model_;
  std::array<Unfinished, 2> unfinished_;
  std::uint64_t last_number_{0};
  std::uint64_t lost_{0};
  std::uint64_t received_{0};
};

}  // namespace fiducap::sdk
