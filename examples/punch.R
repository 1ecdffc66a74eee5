# Solves the problem of a JSON file on a Signorini service, prints the forces, and draws the stresses along a contact.
# Base R and curl are all it needs:
#
#   Rscript examples/punch.R examples/rectangular_punch.json top punch.pdf
#
# The service is that of SIGNORINI_URL, its token that of SIGNORINI_TOKEN, as for `signorini`.

arguments <- commandArgs(trailingOnly = TRUE)
if (length(arguments) != 3) stop("usage: punch.R PROBLEM.json BOUNDARY FIGURE.pdf")
service <- Sys.getenv("SIGNORINI_URL", "http://127.0.0.1:8080")

# The answer of the service as text. What it refuses ends the script with its reasons.
ask <- function(path, body = NULL) {
  options <- c("--silent", "--show-error", "--fail-with-body")
  token <- Sys.getenv("SIGNORINI_TOKEN")
  if (nzchar(token)) options <- c(options, "--header", paste("Authorization: Bearer", token))
  if (!is.null(body)) options <- c(options, "--header", "Content-Type: application/json", "--data-binary", "@-")
  answer <- suppressWarnings(system2("curl", shQuote(c(options, paste0(service, path))), stdout = TRUE, input = body))
  if (!is.null(attr(answer, "status"))) stop(paste(answer, collapse = "\n"))
  paste(answer, collapse = "\n")
}

# One text of a JSON answer, by its name.
text_of <- function(json, name) sub(paste0('^.*?"', name, '":"([^"]*)".*$'), "\\1", json, perl = TRUE)

problem <- paste(readLines(arguments[1]), collapse = "\n")
job <- ask("/v1/jobs", paste0('{"problem":', problem, "}"))
id <- text_of(job, "id")
repeat {
  job <- ask(paste0("/v1/jobs/", id, "?wait=30&until=terminal"))
  status <- text_of(job, "status")
  if (!status %in% c("queued", "running")) break
}
if (status != "succeeded") stop(paste(id, "ended as", status))

stresses <- read.csv(text = ask(paste0("/v1/jobs/", id, "/profiles/", URLencode(arguments[2], reserved = TRUE), "?format=csv")))
peak <- stresses[which.max(abs(stresses$tangential_stress)), ]
cat(sprintf("%s: %d points; largest tangential stress %.6g at s = %.6g (%s)\n",
            id, nrow(stresses), peak$tangential_stress, peak$s, peak$state))

pdf(arguments[3], width = 88 / 25.4, height = 66 / 25.4, pointsize = 8)
par(mar = c(4, 4, 1, 1))
plot(stresses$s, stresses$tangential_stress, type = "l", col = "#D55E00", lwd = 2,
     xlab = "arc length s", ylab = "tangential stress")
lines(stresses$s, stresses$friction_bound, col = "#8a8a8a", lty = 2)
invisible(dev.off())
