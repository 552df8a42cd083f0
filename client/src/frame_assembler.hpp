#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "src/messages.hpp"

namespace fiducap::sdk {

/// Ticks off the parts of one list.
class PartList {
 public:
  void start(const PartPlace& place);
  /// @return false for a part that is there already or that disagrees with the first one about the
  /// list.
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

/// Parts of models and frames → whole frames with names. Remembers two unfinished frames at most,
/// so that parts that overtake each other do no harm; whatever is older than a finished frame is
/// dropped. Nothing grows without limit.
class FrameAssembler {
 public:
  /// A new run of the server: numbers and names start again.
  void begin(std::uint64_t session);
  void add(const ModelPart& part);
  /// @return the frame this part finished, to be taken or changed by the caller before the next
  /// call; else nullptr.
  ///         Frames of another session or of a model that is not complete are ignored.
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
