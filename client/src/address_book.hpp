#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "src/udp_socket.hpp"
#include "src/wake.hpp"

namespace fiducap::sdk {

/// The addresses of a host, tried in turn. Names are looked up on a separate thread, because a
/// look-up may take long and cannot be cancelled; its end signals `wake`.
class AddressBook {
 public:
  AddressBook(std::string host, std::uint16_t port, std::shared_ptr<Wake> wake);

  enum class State { kReady, kLooking, kFailed };
  /// The next address to try. kLooking: call again after the wake; kFailed: `problem` has the
  /// cause, and the next call looks up again.
  State next(Address& address, std::string& problem);
  /// All known addresses were tried. The next call looks the name up again: the server may have
  /// another address.
  bool exhausted() const { return next_ >= addresses_.size(); }
  /// Restarts with a new look-up.
  void forget();

 private:
  struct Lookup;
  void start_lookup();

  std::string host_;
  std::uint16_t port_;
  std::shared_ptr<Wake> wake_;
  std::shared_ptr<Lookup> lookup_;
  std::vector<Address> addresses_;
  std::size_t next_{0};
};

}  // namespace fiducap::sdk
