#include "pipeline/program/fetch_file.h"

#include <curl/curl.h>
#include <openssl/evp.h>

#include <memory>

#include "kernels/base/error.h"
#include "pipeline/program/interrupt.h"

namespace regrade {
namespace {

constexpr int kMostRedirects = 3;

struct Transfer {
  std::string body;
  uint64_t most_bytes = 0;
  bool too_large = false;
};

size_t Take(const char* data, size_t size, size_t count, void* user) {
  Transfer& transfer = *static_cast<Transfer*>(user);
  if (size * count > transfer.most_bytes - transfer.body.size()) {
    transfer.too_large = true;
    return 0;
  }
  transfer.body.append(data, size * count);
  return size * count;
}

int StopIfAsked(void*, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  return StopRequested() ? 1 : 0;
}

struct CloseUrl {
  void operator()(CURLU* url) const { curl_url_cleanup(url); }
};

std::string Part(CURLU* url, CURLUPart part) {
  char* text = nullptr;
  if (curl_url_get(url, part, &text, CURLU_DEFAULT_PORT) != CURLUE_OK) return "";
  const std::string copy = text;
  curl_free(text);
  return copy;
}

// "https://host:port" of an address that may be asked.
std::string CheckedOrigin(const std::string& address, const FetchRules& rules) {
  const std::unique_ptr<CURLU, CloseUrl> url(curl_url());
  if (!url || curl_url_set(url.get(), CURLUPART_URL, address.c_str(), 0) != CURLUE_OK)
    throw InputError("is no address", address);
  const std::string scheme = Part(url.get(), CURLUPART_SCHEME),
                    host = Part(url.get(), CURLUPART_HOST);
  const bool allowed =
      rules.loopback ? scheme == "http" && host == "127.0.0.1" : scheme == "https";
  if (!allowed) throw InputError("only https is asked", address);
  return scheme + "://" + host + ":" + Part(url.get(), CURLUPART_PORT);
}

// One answer; of a redirect `next` gets the address.
std::string Ask(CURL* curl, const std::string& address, const FetchRules& rules,
                std::string* next) {
  Transfer transfer{"", rules.most_bytes};
  char reason[CURL_ERROR_SIZE] = "";
  const char* const protocol = rules.loopback ? "http" : "https";
  curl_easy_reset(curl);
  bool set = true;
  const auto option = [&](CURLoption name, auto value) {
    set = set && curl_easy_setopt(curl, name, value) == CURLE_OK;
  };
  option(CURLOPT_URL, address.c_str());
  option(CURLOPT_PROTOCOLS_STR, protocol);
  option(CURLOPT_FOLLOWLOCATION, 0L);
  option(CURLOPT_FAILONERROR, 1L);
  option(CURLOPT_NOSIGNAL, 1L);
  option(CURLOPT_SSL_VERIFYPEER, 1L);
  option(CURLOPT_SSL_VERIFYHOST, 2L);
  option(CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(1000 * rules.connect_seconds));
  option(CURLOPT_TIMEOUT_MS, static_cast<long>(1000 * rules.seconds));
  option(CURLOPT_WRITEFUNCTION, Take);
  option(CURLOPT_WRITEDATA, static_cast<void*>(&transfer));
  option(CURLOPT_NOPROGRESS, 0L);
  option(CURLOPT_XFERINFOFUNCTION, StopIfAsked);
  option(CURLOPT_ERRORBUFFER, reason);
  REGRADE_CHECK(set);  // a rule that is not kept must not go unnoticed
  const CURLcode code = curl_easy_perform(curl);
  if (StopRequested()) throw Interrupted();
  if (transfer.too_large)
    throw InputError(Concat("has more than ", rules.most_bytes, " bytes"), address);
  if (code != CURLE_OK)
    throw InputError(
        std::string("could not be fetched: ") + (*reason ? reason : curl_easy_strerror(code)),
        address);
  const char* redirect = nullptr;
  curl_easy_getinfo(curl, CURLINFO_REDIRECT_URL, &redirect);
  *next = redirect == nullptr ? "" : redirect;
  return std::move(transfer.body);
}

}  // namespace

std::string FetchFile(const std::string& address, const FetchRules& rules) {
  static const bool ready = curl_global_init(CURL_GLOBAL_DEFAULT) == CURLE_OK;
  const std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> curl(curl_easy_init(),
                                                                 curl_easy_cleanup);
  if (!ready || !curl) throw ResourceError("libcurl does not start", address);
  const std::string origin = CheckedOrigin(address, rules);
  std::string at = address, next;
  for (int i = 0; i <= kMostRedirects; ++i) {
    std::string body = Ask(curl.get(), at, rules, &next);
    if (next.empty()) return body;
    if (CheckedOrigin(next, rules) != origin)
      throw InputError("is redirected to another host: " + next, address);
    at = next;
  }
  throw InputError("is redirected too often", address);
}

std::string FetchLibrary() { return curl_version_info(CURLVERSION_NOW)->version; }

std::string Sha256(std::string_view bytes) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned size = 0;
  REGRADE_CHECK(EVP_Digest(bytes.data(), bytes.size(), digest, &size, EVP_sha256(), nullptr) ==
                1);
  std::string text;
  for (unsigned i = 0; i < size; ++i) text += Format("%02x", digest[i]);
  return text;
}

}  // namespace regrade
