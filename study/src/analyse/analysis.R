# The tables of an analysis once more, by base R: Rscript analysis.R. Written by haptograph study analyse.
# It reads ../trials.csv and ../participants.csv, and prints tables: variance, comparisons, relations, abx.
PHASES
options(contrasts = c("contr.treatment", "contr.poly"))
here <- gsub("~+~", " ", sub("^--file=", "", grep("^--file=", commandArgs(FALSE), value = TRUE)), fixed = TRUE)
here <- if (length(here)) here[1] else tryCatch(sys.frame(1)$ofile, error = function(e) NULL)
folder <- if (is.null(here)) "." else dirname(here)

lines_of <- function(name) {
    path <- file.path(folder, "..", name)
    lines <- readLines(path, encoding = "UTF-8", warn = FALSE)
    # A last line without its end was never confirmed.
    if (tail(readBin(path, "raw", file.size(path)), 1) != as.raw(10)) lines <- head(lines, -1)
    lines[1] <- sub("^[^A-Za-z]*", "", lines[1], useBytes = TRUE)
    read.csv(text = lines, colClasses = "character", na.strings = character(), check.names = FALSE)
}
people <- lines_of("participants.csv")
trials <- lines_of("trials.csv")
# Of several attempts the last counts; who has withdrawn is left out, as are training and skipped trials.
trials <- trials[!duplicated(trials[c("participant", "trial")], fromLast = TRUE), ]
trials <- trials[!trials$participant %in% people$participant[people$withdrawn_utc != ""], ]
trials <- trials[trials$status != "skipped" & tolower(trials$training) == "false", ]
trials$rating <- as.numeric(trials$rating)
chosen <- trials[trials$choice != "", ]
trials <- trials[!is.na(trials$rating), ]

in_order <- function(names) sort(unique(names), method = "radix")
# A row a person, a column a cell.
wide <- function(rows, cell) tapply(rows$rating, list(rows$participant, factor(cell, levels = in_order(cell))), mean)
over_deviation <- function(table) {
    deviation <- apply(table, 1, sd, na.rm = TRUE)
    table / ifelse(!is.na(deviation) & deviation > 0, deviation, NA)
}
complete <- function(table) table[stats::complete.cases(table), , drop = FALSE]
attempt <- function(expression) tryCatch(suppressWarnings(expression), error = function(e) NULL)
found <- list(variance = NULL, comparisons = NULL, relations = NULL, abx = NULL)
add <- function(table, ...) found[[table]] <<- rbind(found[[table]], data.frame(..., stringsAsFactors = FALSE))
add_term <- function(phase, test, of, name, table, row, corrected = NA) {
    if (is.null(table)) return()
    add("variance", phase = phase, test = test, of = of, term = name, df = table[row, "Df"], residual_df = table[nrow(table), "Df"],
        f = table[row, "F value"], p = table[row, "Pr(>F)"], p_greenhouse_geisser = corrected)
}
corrected <- function(table, cells, M, X) {
    p <- attempt(anova(lm(table ~ 1), M = M, X = X, idata = cells, test = "Spherical")[1, "G-G Pr"])
    if (is.null(p)) NA else p
}
between <- "as in the thesis"; within <- "repeated measures"

one_factor <- function(phase, of, term, table) {
    d <- data.frame(rating = c(table), person = factor(c(row(table))), level = factor(c(col(table))))
    add_term(phase, between, of, term, attempt(summary(aov(rating ~ level, d))[[1]]), 1)
    repeated(phase, of, term, table, d)
}
repeated <- function(phase, of, term, table, d) {
    strata <- attempt(summary(aov(rating ~ level + Error(person / level), d)))
    own <- strata[["Error: person:level"]][[1]]
    add_term(phase, within, of, term, own, 1, corrected(table, data.frame(level = factor(seq_len(ncol(table)))), ~level, ~1))
    own
}
two_factors <- function(phase, of, table, cells) {
    at <- c(col(table))
    d <- data.frame(rating = c(table), person = factor(c(row(table))), a = cells$surface[at], b = cells$version[at])
    names <- c("surface", "version", "surface x version")
    own <- attempt(summary(aov(rating ~ a * b, d))[[1]])
    for (row in 1:3) add_term(phase, between, of, names[row], own, row)
    strata <- attempt(summary(aov(rating ~ a * b + Error(person / (a * b)), d)))
    models <- list(list(~surface, ~1), list(~ surface + version, ~surface), list(~ surface * version, ~ surface + version))
    for (row in 1:3) {
        stratum <- strata[[paste0("Error: person:", c("a", "b", "a:b")[row])]][[1]]
        add_term(phase, within, of, names[row], stratum, 1, corrected(table, cells, models[[row]][[1]], models[[row]][[2]]))
    }
}

rate <- function(phase, rows) {
    means <- list()
    for (scale in in_order(rows$scale)) {
        own <- rows[rows$scale == scale, ]
        cell <- paste(own$first_surface, own$first_version, sep = "\t")
        table <- over_deviation(wide(own, cell))
        means[[scale]] <- colMeans(table, na.rm = TRUE)
        cells <- do.call(rbind, strsplit(colnames(table), "\t", fixed = TRUE))
        counts <- base::table(cells[, 1])
        # A surface without one of the versions is no part of the two factors.
        is_crossed <- cells[, 1] %in% names(counts)[counts == length(unique(cells[, 2]))]
        table <- complete(table[, is_crossed, drop = FALSE])
        cells <- data.frame(surface = factor(cells[is_crossed, 1]), version = factor(cells[is_crossed, 2]))
        levels <- c(nlevels(cells$surface), nlevels(cells$version))
        if (all(levels > 1)) two_factors(phase, scale, table, cells)
        else if (any(levels > 1)) one_factor(phase, scale, if (levels[2] == 1) "surface" else "version", table)
    }
    pairs <- if (length(means) > 1) combn(names(means), 2) else matrix("", 2, 0)
    for (pair in seq_len(ncol(pairs))) {
        two <- pairs[, pair]
        r <- attempt(cor.test(means[[two[1]]], means[[two[2]]]))
        if (!is.null(r)) add("relations", phase = phase, kind = "correlation", of = two[1], with = two[2], value = r$estimate, p = r$p.value)
    }
    means
}

compare <- function(phase, rows) {
    for (surface in in_order(rows$second_surface)) {
        own <- rows[rows$second_surface == surface, ]
        table <- complete(wide(own, own$second_version))
        versions <- colnames(table)
        if (nrow(table) < 2 || ncol(table) < 2) next
        pairs <- combn(ncol(table), 2)
        compared <- function(test, difference, p)
            add("comparisons", phase = phase, test = test, surface = surface, from = versions[pairs[1, ]], to = versions[pairs[2, ]],
                difference = difference, p = p)
        d <- data.frame(rating = c(table), person = factor(c(row(table))), level = factor(c(col(table))))
        for (test in c(between, "as in the thesis, not centred")) {
            if (test == between) d$shown <- d$rating - rowMeans(table)[c(row(table))] else d$shown <- d$rating
            fit <- attempt(aov(shown ~ level, d))
            add_term(phase, test, surface, "version", summary(fit)[[1]], 1)
            tukey <- attempt(TukeyHSD(fit)$level)
            if (!is.null(tukey)) compared(test, tukey[, "diff"], tukey[, "p adj"])
        }
        error <- repeated(phase, surface, "version", table, d)
        difference <- colMeans(table)[pairs[2, ]] - colMeans(table)[pairs[1, ]]
        if (!is.null(error)) {
            q <- abs(difference) / sqrt(error[2, "Mean Sq"] / nrow(table))
            compared(within, difference, ptukey(q, ncol(table), error[2, "Df"], lower.tail = FALSE))
        }
        ranks <- attempt(friedman.test(table))
        if (!is.null(ranks)) add("variance", phase = phase, test = "ranks", of = surface, term = "version", df = ranks$parameter, residual_df = NA,
                                 f = ranks$statistic, p = ranks$p.value, p_greenhouse_geisser = NA)
        p <- apply(pairs, 2, function(pair) suppressWarnings(wilcox.test(table[, pair[2]], table[, pair[1]], paired = TRUE)$p.value))
        compared("ranks", NA, p.adjust(ifelse(is.nan(p), 1, p), "holm"))
    }
}

pairs_of <- function(phase, rows, same_is_from, means) {
    first <- paste(rows$first_surface, rows$first_version, sep = "\t")
    second <- paste(rows$second_surface, rows$second_version, sep = "\t")
    if (!same_is_from) rows$rating <- 1 - rows$rating
    cell <- ifelse(first < second, paste(first, second, sep = "\n"), paste(second, first, sep = "\n"))
    d <- colMeans(over_deviation(wide(rows, cell)), na.rm = TRUE)
    two <- do.call(rbind, strsplit(names(d), "\n", fixed = TRUE))
    if (length(means) > 0 && all(two %in% names(means[[1]]))) {
        x <- sapply(means, function(of) abs(of[two[, 1]] - of[two[, 2]]))
        b <- attempt(summary(lm(d ~ 0 + x))$coefficients)
        if (!is.null(b)) add("relations", phase = phase, kind = "regression of dissimilarity on differences of ratings (Eq. 3.3.1)",
                             of = "dissimilarity", with = names(means), value = b[, "Estimate"], p = b[, "Pr(>|t|)"])
    }
    stimuli <- in_order(c(two))
    matrix <- matrix(0, length(stimuli), length(stimuli), dimnames = list(sub("\t", ", ", stimuli), NULL))
    matrix[cbind(match(two[, 1], stimuli), match(two[, 2], stimuli))] <- d
    if (!requireNamespace("MASS", quietly = TRUE)) return()
    cat("# map of", phase, "by isoMDS of MASS: stress (%) in 1, 2, 3 dimensions; Ward's tree\n")
    for (k in seq_len(min(3, length(stimuli) - 2))) {
        map <- attempt(MASS::isoMDS(as.dist(matrix + t(matrix)), k = k, trace = FALSE))
        if (!is.null(map)) cat("#", k, format(map$stress), "\n")
    }
    if (is.null(map)) return()
    tree <- hclust(dist(map$points), "ward.D2")
    name <- function(at) if (at < 0) tree$labels[-at] else paste("merge", at)
    for (step in seq_along(tree$height))
        cat("# merge ", step, ": ", name(tree$merge[step, 1]), " + ", name(tree$merge[step, 2]), " at ", format(tree$height[step]), "\n", sep = "")
}

# d' of the differencing model (Macmillan and Creelman 2005): none below a share of a half and at 1.
d_prime <- function(share) {
    if (share < 0.5 || share >= 1) return(NA)
    of <- function(d) pnorm(d / sqrt(2)) * pnorm(d / sqrt(6)) + pnorm(-d / sqrt(2)) * pnorm(-d / sqrt(6)) - share
    uniroot(of, c(0, 20), tol = 1e-12)$root
}
# Two-sided and exact; without answers nothing is found.
exact <- function(count, all) if (all == 0) 1 else binom.test(count, all)$p.value
abx <- function(phase, rows) {
    names <- cbind(paste(rows$first_surface, rows$first_version, sep = ", "), paste(rows$second_surface, rows$second_version, sep = ", "))
    # What X was is the first one.
    is_right <- rows$choice == names[, 1]
    pair <- apply(names, 1, function(two) paste(in_order(two), collapse = " / "))
    for (one in in_order(pair)) {
        own <- pair == one
        balance <- tapply(ifelse(is_right[own], 1, -1), rows$participant[own], sum)
        for (code in c(in_order(rows$participant[own]), "")) {
            of <- is_right[own & (code == "" | rows$participant == code)]
            ends <- suppressWarnings(prop.test(sum(of), length(of), correct = FALSE)$conf.int)
            add("abx", phase = phase, pair = one, participant = code, answers = length(of), share_right = mean(of), low = ends[1], high = ends[2],
                p = exact(sum(of), length(of)), d_prime = d_prime(mean(of)), d_prime_low = d_prime(max(ends[1], 0.5)), d_prime_high = d_prime(ends[2]),
                p_of_people = if (code == "") exact(sum(balance > 0), sum(balance != 0)) else NA)
        }
    }
}

if (any(tolower(c(trials$simulated, chosen$simulated)) == "true")) cat("# simulated people\n")
means <- list()
for (phase in phases) if (phase$kind == "rate") means[[phase$name]] <- rate(phase$name, trials[trials$phase == phase$name, ])
for (phase in phases) {
    rows <- trials[trials$phase == phase$name, ]
    if (phase$kind == "abx" && any(chosen$phase == phase$name)) abx(phase$name, chosen[chosen$phase == phase$name, ])
    if (nrow(rows) > 0 && phase$kind == "compare") compare(phase$name, rows)
    if (nrow(rows) > 0 && phase$kind == "pairs") pairs_of(phase$name, rows, phase$same_is_from, if (nzchar(phase$ratings)) means[[phase$ratings]])
}
for (table in names(found)) if (!is.null(found[[table]])) {
    cat("# ", table, "\n", sep = "")
    write.csv(found[[table]], row.names = FALSE)
}
