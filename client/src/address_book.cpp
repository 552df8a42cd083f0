#include "src/address_book.hpp"

#include <netdb.h>

#include <cstring>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

namespace fiducap::sdk {

namespace {

/// @return 0 or the code of getaddrinfo
int look_up(const std::string& host, std::uint16_t port, int flags, std::vector<Address>& out) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_DGRAM;
  hints.ai_flags = flags | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  const int code = ::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found);
  if (code != 0) return code;
  for (const addrinfo* it = found; it != nullptr; it = it->ai_next) {
    Address address;
    std::memcpy(&address.bytes, it->ai_addr, it->ai_addrlen);
    address.size = it->ai_addrlen;
    out.push_back(address);
  }
  ::freeaddrinfo(found);
  return 0;
}

}  // namespace

/// Shared with the look-up thread, which may outlive the client.
struct AddressBook::Lookup {
  std::mutex mutex;
  bool done{false};
  int code{0};
  std::vector<Address> addresses;
};

AddressBook::AddressBook(std::string host, std::uint16_t port, std::shared_ptr<Wake> wake)
    : host_(std::move(host)), port_(port), wake_(std::move(wake)) {}

AddressBook::State AddressBook::next(Address& address, std::string& problem) {
  if (exhausted() && !lookup_) {
    forget();
    if (look_up(host_, port_, AI_NUMERICHOST, addresses_) != 0) start_lookup();
  }
  if (lookup_) {
    const auto lookup = lookup_;
    const std::lock_guard<std::mutex> lock(lookup->mutex);
    if (!lookup->done) return State::kLooking;
    lookup_.reset();
    if (lookup->code != 0) {
      problem = "host name " + host_ + " not found: " + ::gai_strerror(lookup->code);
      return State::kFailed;
    }
    addresses_ = lookup->addresses;
  }
  if (exhausted()) {
    problem = "host name " + host_ + " has no address";
    return State::kFailed;
  }
  address = addresses_[next_++];
  return State::kReady;
}

void AddressBook::start_lookup() {
  lookup_ = std::make_shared<Lookup>();
  const auto work = [lookup = lookup_, wake = wake_, host = host_, port = port_] {
    std::vector<Address> addresses;
    const int code = look_up(host, port, AI_ADDRCONFIG, addresses);
    {
      const std::lock_guard<std::mutex> lock(lookup->mutex);
      lookup->code = code;
      lookup->addresses = std::move(addresses);
      lookup->done = true;
    }
    wake->ring();
  };
  try {
    std::thread(work).detach();
  } catch (const std::system_error&) {  // no thread left: as if the name server did not reply
    lookup_->code = EAI_AGAIN;
    lookup_->done = true;
  }
}

void AddressBook::forget() {
  addresses_.clear();
  next_ = 0;
}

}  // namespace fiducap::sdk
